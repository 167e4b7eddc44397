//! The registers of NEON.

use std::arch::aarch64::*;
use std::arch::asm;

use half::f16;

use super::isa::Isa;
use super::machine::{BLOCK, Kernel, LANES, Machine};

instruction_set!(Neon, "neon");

impl Machine for Neon {
    type Floats = [float32x4_t; 4];
    type Wide = float64x2_t;
    type Lanes = [float64x2_t; 8];
    type Block = [uint8x16_t; 4];
    type Shorts = [int16x8_t; 8];
    type Counts = int32x4_t;
    const OFFSET: i64 = 0;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        intrinsics!(inside(self, kernel));
    }

    #[inline(always)]
    fn lanes(self) -> Self::Lanes {
        intrinsics!([vdupq_n_f64(0.0); 8])
    }

    #[inline(always)]
    fn f32s(self, numbers: &[f32; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| vld1q_f32(parts[part].as_ptr()))
    }

    #[inline(always)]
    fn f16s(self, numbers: &[f16; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| {
            let wide: float32x4_t;
            let numbers = vld1_u16(parts[part].as_ptr().cast());
            // Stable Rust has no name for this instruction.
            asm!("fcvtl {0:v}.4s, {1:v}.4h", out(vreg) wide, in(vreg) numbers,
                options(pure, nomem, nostack));
            wide
        })
    }

    #[inline(always)]
    fn i8s(self, numbers: &[i8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1 2 3] |part| {
            let numbers = vmovl_s8(vld1_s8(parts[part / 2].as_ptr()));
            let four =
                if part % 2 == 1 { vget_high_s16(numbers) } else { vget_low_s16(numbers) };
            vcvtq_f32_s32(vmovl_s16(four))
        })
    }

    #[inline(always)]
    fn u8s(self, numbers: &[u8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1 2 3] |part| {
            let numbers = vmovl_u8(vld1_u8(parts[part / 2].as_ptr()));
            let four =
                if part % 2 == 1 { vget_high_u16(numbers) } else { vget_low_u16(numbers) };
            vcvtq_f32_u32(vmovl_u16(four))
        })
    }

    #[inline(always)]
    fn subtract(self, a: Self::Floats, b: Self::Floats) -> Self::Floats {
        parts!([0 1 2 3] |part| vsubq_f32(a[part], b[part]))
    }

    #[inline(always)]
    fn widen(self, numbers: Self::Floats) -> Self::Lanes {
        parts!([0 1 2 3 4 5 6 7] |part| {
            let four = numbers[part / 2];
            if part % 2 == 1 { vcvt_high_f64_f32(four) } else { vcvt_f64_f32(vget_low_f32(four)) }
        })
    }

    #[inline(always)]
    fn absolute(self, sum: float64x2_t, a: float64x2_t) -> float64x2_t {
        intrinsics!(vaddq_f64(sum, vabsq_f64(a)))
    }

    #[inline(always)]
    fn product(self, sum: float64x2_t, a: float64x2_t, b: float64x2_t) -> float64x2_t {
        intrinsics!(vfmaq_f64(sum, a, b))
    }

    #[inline(always)]
    fn store(self, lanes: Self::Lanes) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        let parts = sums.as_chunks_mut::<2>().0;
        parts!([0 1 2 3 4 5 6 7] |part| vst1q_f64(parts[part].as_mut_ptr(), lanes[part]));
        sums
    }

    #[inline(always)]
    fn counts(self) -> int32x4_t {
        intrinsics!(vdupq_n_s32(0))
    }

    #[inline(always)]
    fn block(self, bytes: &[u8; BLOCK]) -> Self::Block {
        let parts = bytes.as_chunks::<16>().0;
        parts!([0 1 2 3] |part| vld1q_u8(parts[part].as_ptr()))
    }

    #[inline(always)]
    fn flip(self, block: Self::Block) -> Self::Block {
        parts!([0 1 2 3] |part| veorq_u8(block[part], vdupq_n_u8(0x80)))
    }

    #[inline(always)]
    fn differences(self, sum: int32x4_t, a: Self::Block, b: Self::Block) -> int32x4_t {
        intrinsics!({
            let mut sums = vdupq_n_u16(0);
            for part in 0..4 {
                sums = vpadalq_u8(sums, vabdq_u8(a[part], b[part]));
            }
            vreinterpretq_s32_u32(vpadalq_u16(vreinterpretq_u32_s32(sum), sums))
        })
    }

    #[inline(always)]
    fn squares(self, sum: int32x4_t, a: Self::Block, b: Self::Block) -> int32x4_t {
        let differences = parts!([0 1 2 3] |part| vabdq_u8(a[part], b[part]));
        self.products_u8(sum, differences, differences)
    }

    #[inline(always)]
    fn products_u8(self, sum: int32x4_t, a: Self::Block, b: Self::Block) -> int32x4_t {
        intrinsics!({
            let mut sum = vreinterpretq_u32_s32(sum);
            for part in 0..4 {
                let (a, b) = (a[part], b[part]);
                sum = vpadalq_u16(sum, vmull_u8(vget_low_u8(a), vget_low_u8(b)));
                sum = vpadalq_u16(sum, vmull_high_u8(a, b));
            }
            vreinterpretq_s32_u32(sum)
        })
    }

    #[inline(always)]
    fn products_i8(self, mut sum: int32x4_t, query: Self::Block, row: Self::Block) -> int32x4_t {
        for part in 0..4 {
            intrinsics!({
                let (a, b) = (vreinterpretq_s8_u8(query[part]), vreinterpretq_s8_u8(row[part]));
                sum = vpadalq_s16(sum, vmull_s8(vget_low_s8(a), vget_low_s8(b)));
                sum = vpadalq_s16(sum, vmull_high_s8(a, b));
            });
        }
        sum
    }

    #[inline(always)]
    fn shorts(self, numbers: &[i16; BLOCK]) -> Self::Shorts {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1 2 3 4 5 6 7] |part| vld1q_s16(parts[part].as_ptr()))
    }

    #[inline(always)]
    fn products_i16(self, mut sum: int32x4_t, query: Self::Shorts, row: &[i8; BLOCK]) -> int32x4_t {
        let parts = row.as_chunks::<8>().0;
        for part in 0..8 {
            intrinsics!({
                let (query, row) = (query[part], vmovl_s8(vld1_s8(parts[part].as_ptr())));
                sum = vmlal_s16(sum, vget_low_s16(query), vget_low_s16(row));
                sum = vmlal_high_s16(sum, query, row);
            });
        }
        sum
    }

    #[inline(always)]
    fn total_differences(self, sum: int32x4_t) -> i64 {
        self.total(sum)
    }

    #[inline(always)]
    fn total(self, sum: int32x4_t) -> i64 {
        intrinsics!(vaddlvq_s32(sum))
    }
}
