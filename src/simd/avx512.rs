//! The registers of AVX-512: F, BW, DQ, VL and VNNI.

use std::arch::x86_64::*;

use half::f16;

use super::isa::{Isa, fetch};
use super::machine::{BLOCK, Kernel, LANES, Machine};

instruction_set!(Avx512, "avx512f,avx512bw,avx512dq,avx512vl,avx512vnni");

impl Machine for Avx512 {
    type Floats = [__m256; 2];
    type Wide = __m512d;
    type Lanes = [__m512d; 2];
    type Block = __m512i;
    type Shorts = [__m512i; 2];
    type Counts = __m512i;
    const OFFSET: i64 = 128;

    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) {
        intrinsics!(inside(self, kernel));
    }

    #[inline(always)]
    fn lanes(self) -> Self::Lanes {
        intrinsics!([_mm512_setzero_pd(); 2])
    }

    #[inline(always)]
    fn f32s(self, numbers: &[f32; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1] |part| _mm256_loadu_ps(parts[part].as_ptr()))
    }

    #[inline(always)]
    fn f16s(self, numbers: &[f16; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1] |part| _mm256_cvtph_ps(_mm_loadu_si128(parts[part].as_ptr().cast())))
    }

    #[inline(always)]
    fn i8s(self, numbers: &[i8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1] |part| {
            _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(parts[part].as_ptr().cast())))
        })
    }

    #[inline(always)]
    fn u8s(self, numbers: &[u8; LANES]) -> Self::Floats {
        let parts = numbers.as_chunks::<8>().0;
        parts!([0 1] |part| {
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(parts[part].as_ptr().cast())))
        })
    }

    #[inline(always)]
    fn subtract(self, a: Self::Floats, b: Self::Floats) -> Self::Floats {
        parts!([0 1] |part| _mm256_sub_ps(a[part], b[part]))
    }

    #[inline(always)]
    fn widen(self, numbers: Self::Floats) -> Self::Lanes {
        parts!([0 1] |part| _mm512_cvtps_pd(numbers[part]))
    }

    #[inline(always)]
    fn fetch<T>(self, ahead: *const T) {
        fetch(ahead);
    }

    #[inline(always)]
    fn absolute(self, sum: __m512d, a: __m512d) -> __m512d {
        intrinsics!(_mm512_add_pd(sum, _mm512_abs_pd(a)))
    }

    #[inline(always)]
    fn product(self, sum: __m512d, a: __m512d, b: __m512d) -> __m512d {
        intrinsics!(_mm512_fmadd_pd(a, b, sum))
    }

    #[inline(always)]
    fn store(self, lanes: Self::Lanes) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        let parts = sums.as_chunks_mut::<8>().0;
        parts!([0 1] |part| _mm512_storeu_pd(parts[part].as_mut_ptr(), lanes[part]));
        sums
    }

    #[inline(always)]
    fn counts(self) -> __m512i {
        intrinsics!(_mm512_setzero_si512())
    }

    #[inline(always)]
    fn block(self, bytes: &[u8; BLOCK]) -> __m512i {
        intrinsics!(_mm512_loadu_si512(bytes.as_ptr().cast()))
    }

    #[inline(always)]
    fn flip(self, block: __m512i) -> __m512i {
        intrinsics!(_mm512_xor_si512(block, _mm512_set1_epi8(i8::MIN)))
    }

    #[inline(always)]
    fn differences(self, sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
        intrinsics!(_mm512_add_epi64(sum, _mm512_sad_epu8(a, b)))
    }

    #[inline(always)]
    fn squares(self, sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
        intrinsics!({
            let difference = _mm512_sub_epi8(_mm512_max_epu8(a, b), _mm512_min_epu8(a, b));
            self.products_u8(sum, difference, difference)
        })
    }

    #[inline(always)]
    fn products_u8(self, sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
        intrinsics!({
            let bytes = _mm512_set1_epi16(0xFF);
            let even = [_mm512_and_si512(a, bytes), _mm512_and_si512(b, bytes)];
            let odd = [_mm512_srli_epi16::<8>(a), _mm512_srli_epi16::<8>(b)];
            let sum = _mm512_dpwssd_epi32(sum, even[0], even[1]);
            _mm512_dpwssd_epi32(sum, odd[0], odd[1])
        })
    }

    #[inline(always)]
    fn products_i8(self, sum: __m512i, query: __m512i, row: __m512i) -> __m512i {
        intrinsics!(_mm512_dpbusd_epi32(sum, self.flip(row), query))
    }

    #[inline(always)]
    fn shorts(self, numbers: &[i16; BLOCK]) -> Self::Shorts {
        let parts = numbers.as_chunks::<32>().0;
        parts!([0 1] |part| _mm512_loadu_si512(parts[part].as_ptr().cast()))
    }

    #[inline(always)]
    fn products_i16(self, mut sum: __m512i, query: Self::Shorts, row: &[i8; BLOCK]) -> __m512i {
        let parts = row.as_chunks::<32>().0;
        for part in 0..2 {
            intrinsics!({
                let row = _mm512_cvtepi8_epi16(_mm256_loadu_si256(parts[part].as_ptr().cast()));
                sum = _mm512_dpwssd_epi32(sum, query[part], row);
            });
        }
        sum
    }

    #[inline(always)]
    fn total_differences(self, sum: __m512i) -> i64 {
        intrinsics!(_mm512_reduce_add_epi64(sum))
    }

    #[inline(always)]
    fn total(self, sum: __m512i) -> i64 {
        intrinsics!({
            let low = _mm512_cvtepi32_epi64(_mm512_castsi512_si256(sum));
            let high = _mm512_cvtepi32_epi64(_mm512_extracti64x4_epi64::<1>(sum));
            _mm512_reduce_add_epi64(_mm512_add_epi64(low, high))
        })
    }
}
