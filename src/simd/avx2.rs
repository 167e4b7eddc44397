//! The registers of AVX2, with FMA and F16C.

use std::arch::x86_64::*;

use half::f16;

use super::isa::{Isa, fetch};
use super::machine::{BLOCK, Kernel, LANES, Machine};

instruction_set!(Avx2, "avx2,fma,f16c");

impl Machine for Avx2 {
    type Floats = [__m128; 4];
    type Wide = __m256d;
    type Lanes = [__m256d; 4];
    type Block = [__m256i; 2];
    type Shorts = [__m256i; 4];
    type Counts = __m256i;
    const OFFSET: i64 = 0;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        intrinsics!(inside(self, kernel));
    }

    #[inline(always)]
    fn lanes(self) -> Self::Lanes {
        intrinsics!([_mm256_setzero_pd(); 4])
    }

    #[inline(always)]
    fn f32s(self, numbers: &[f32; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| _mm_loadu_ps(parts[part].as_ptr()))
    }

    #[inline(always)]
    fn f16s(self, numbers: &[f16; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| _mm_cvtph_ps(_mm_loadl_epi64(parts[part].as_ptr().cast())))
    }

    #[inline(always)]
    fn i8s(self, numbers: &[i8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| {
            _mm_cvtepi32_ps(_mm_cvtepi8_epi32(_mm_loadu_si32(parts[part].as_ptr().cast())))
        })
    }

    #[inline(always)]
    fn u8s(self, numbers: &[u8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<4>().0;
        parts!([0 1 2 3] |part| {
            _mm_cvtepi32_ps(_mm_cvtepu8_epi32(_mm_loadu_si32(parts[part].as_ptr().cast())))
        })
    }

    #[inline(always)]
    fn subtract(self, a: Self::Floats, b: Self::Floats) -> Self::Floats {
        parts!([0 1 2 3] |part| _mm_sub_ps(a[part], b[part]))
    }

    #[inline(always)]
    fn widen(self, numbers: Self::Floats) -> Self::Lanes {
        parts!([0 1 2 3] |part| _mm256_cvtps_pd(numbers[part]))
    }

    #[inline(always)]
    fn fetch<T>(self, ahead: *const T) {
        fetch(ahead);
    }

    #[inline(always)]
    fn absolute(self, sum: __m256d, a: __m256d) -> __m256d {
        intrinsics!(_mm256_add_pd(sum, _mm256_andnot_pd(_mm256_set1_pd(-0.0), a)))
    }

    #[inline(always)]
    fn product(self, sum: __m256d, a: __m256d, b: __m256d) -> __m256d {
        intrinsics!(_mm256_fmadd_pd(a, b, sum))
    }

    #[inline(always)]
    fn store(self, lanes: Self::Lanes) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        let parts = sums.as_chunks_mut::<4>().0;
        parts!([0 1 2 3] |part| _mm256_storeu_pd(parts[part].as_mut_ptr(), lanes[part]));
        sums
    }

    #[inline(always)]
    fn counts(self) -> __m256i {
        intrinsics!(_mm256_setzero_si256())
    }

    #[inline(always)]
    fn block(self, bytes: &[u8; BLOCK]) -> Self::Block {
        let halves = bytes.as_chunks::<32>().0;
        parts!([0 1] |half| _mm256_loadu_si256(halves[half].as_ptr().cast()))
    }

    #[inline(always)]
    fn flip(self, block: Self::Block) -> Self::Block {
        parts!([0 1] |half| _mm256_xor_si256(block[half], _mm256_set1_epi8(i8::MIN)))
    }

    #[inline(always)]
    fn differences(self, sum: __m256i, a: Self::Block, b: Self::Block) -> __m256i {
        intrinsics!({
            let low = _mm256_add_epi64(sum, _mm256_sad_epu8(a[0], b[0]));
            _mm256_add_epi64(low, _mm256_sad_epu8(a[1], b[1]))
        })
    }

    #[inline(always)]
    fn squares(self, sum: __m256i, a: Self::Block, b: Self::Block) -> __m256i {
        let differences = parts!([0 1] |half| {
            _mm256_sub_epi8(_mm256_max_epu8(a[half], b[half]), _mm256_min_epu8(a[half], b[half]))
        });
        self.products_u8(sum, differences, differences)
    }

    #[inline(always)]
    fn products_u8(self, mut sum: __m256i, a: Self::Block, b: Self::Block) -> __m256i {
        for half in 0..2 {
            intrinsics!({
                let (a, b) = (a[half], b[half]);
                let bytes = _mm256_set1_epi16(0xFF);
                let even = [_mm256_and_si256(a, bytes), _mm256_and_si256(b, bytes)];
                let odd = [_mm256_srli_epi16::<8>(a), _mm256_srli_epi16::<8>(b)];
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(even[0], even[1]));
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(odd[0], odd[1]));
            });
        }
        sum
    }

    #[inline(always)]
    fn products_i8(self, mut sum: __m256i, query: Self::Block, row: Self::Block) -> __m256i {
        for half in 0..2 {
            intrinsics!({
                let (a, b) = (query[half], row[half]);
                let low = [_mm256_slli_epi16::<8>(a), _mm256_slli_epi16::<8>(b)];
                let even = [_mm256_srai_epi16::<8>(low[0]), _mm256_srai_epi16::<8>(low[1])];
                let odd = [_mm256_srai_epi16::<8>(a), _mm256_srai_epi16::<8>(b)];
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(even[0], even[1]));
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(odd[0], odd[1]));
            });
        }
        sum
    }

    #[inline(always)]
    fn shorts(self, numbers: &[i16; BLOCK]) -> Self::Shorts {
        let parts = numbers.as_chunks::<16>().0;
        parts!([0 1 2 3] |part| _mm256_loadu_si256(parts[part].as_ptr().cast()))
    }

    #[inline(always)]
    fn products_i16(self, mut sum: __m256i, query: Self::Shorts, row: &[i8; BLOCK]) -> __m256i {
        let parts = row.as_chunks::<16>().0;
        for part in 0..4 {
            intrinsics!({
                let row = _mm256_cvtepi8_epi16(_mm_loadu_si128(parts[part].as_ptr().cast()));
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(query[part], row));
            });
        }
        sum
    }

    #[inline(always)]
    fn total_differences(self, sum: __m256i) -> i64 {
        let mut sums = [0_i64; 4];
        intrinsics!(_mm256_storeu_si256(sums.as_mut_ptr().cast(), sum));
        sums[0] + sums[1] + sums[2] + sums[3]
    }

    #[inline(always)]
    fn total(self, sum: __m256i) -> i64 {
        intrinsics!({
            let low = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(sum));
            let high = _mm256_cvtepi32_epi64(_mm256_extracti128_si256::<1>(sum));
            self.total_differences(_mm256_add_epi64(low, high))
        })
    }
}
