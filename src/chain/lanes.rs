//! Four numbers at once: the vectors in which the fast solvers are written, and what each code path makes of them.
//!
//! Left to itself the compiler turned some of the kernel's loops into vectors and others, after a harmless change, no
//! longer; written out, the same frame takes half the time (`cargo bench --bench frame`). Called by the solvers only.

use std::ops::{Add, Div, Mul, Sub};

/// The instructions that a code path may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// 256-bit vectors with fused multiply-add, and twice the registers.
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// What every processor of the architecture has.
    Portable,
}

impl Instructions {
    /// All code paths that this processor can run, the fastest first.
    pub fn available() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            let mut available = Vec::new();
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
            {
                available.push(Self::Avx512);
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                available.push(Self::Avx2);
            }
            available.push(Self::Portable);
            available
        }
        #[cfg(not(target_arch = "x86_64"))]
        vec![Self::Portable]
    }

    /// The name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2 and FMA",
            Self::Portable => "portable",
        }
    }
}

/// How many numbers stand side by side.
pub(super) const LANES: usize = 4;

/// Four numbers in memory, where a vector loads them in one piece.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(super) struct Row(pub [f64; LANES]);

impl Row {
    /// Four zeros.
    pub(super) const ZERO: Self = Self([0.0; LANES]);
}

/// Four doubles in a register.
pub(super) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Four numbers of 64 bits in a register.
    type Bits: Bits;

    /// The same number four times.
    fn all(number: f64) -> Self;
    /// The numbers of a row.
    fn load(row: &Row) -> Self;
    /// The numbers as a row.
    fn row(self) -> Row;
    /// `self * y + z`: one rounding where the processor has the instruction, two where it would be a library call.
    fn multiply_add(self, y: Self, z: Self) -> Self;
    /// `z - self * y`, rounded in the same way.
    fn negated_multiply_add(self, y: Self, z: Self) -> Self;
    /// The square roots.
    fn sqrt(self) -> Self;
    /// The sizes, without their signs.
    fn abs(self) -> Self;
    /// The greater of two numbers, lane by lane.
    fn max(self, other: Self) -> Self;
    /// The smaller of two numbers, lane by lane.
    fn min(self, other: Self) -> Self;
    /// Whether any number is above `limit`, or not a number.
    fn any_above(self, limit: f64) -> bool;
    /// `least` where a number is at most `least`, with the sign turned round: closes an interval at its other end.
    fn wrapped_up_from(self, least: f64) -> Self;
    /// The numbers' bits.
    fn bits(self) -> Self::Bits;
    /// The numbers that have these bits.
    fn from_bits(bits: Self::Bits) -> Self;
    /// `odd` where the lowest bit of `quadrant` is set, `self` elsewhere.
    fn or_if_odd(self, odd: Self, quadrant: Self::Bits) -> Self;
    /// Rows to columns.
    fn transposed(rows: [Self; LANES]) -> [Self; LANES];
}

/// Four numbers of 64 bits.
pub(super) trait Bits: Copy {
    /// The same number four times.
    fn all(number: u64) -> Self;
    /// The sum modulo 2^64.
    fn plus(self, other: Self) -> Self;
    /// The difference modulo 2^64.
    fn minus(self, other: Self) -> Self;
    /// Bits set in both.
    fn and(self, other: Self) -> Self;
    /// Bits set in either.
    fn or(self, other: Self) -> Self;
    /// Bits set in one only.
    fn xor(self, other: Self) -> Self;
    /// Bits moved up by `N` places.
    fn up<const N: i32>(self) -> Self;
    /// Bits moved down by `N` places.
    fn down<const N: i32>(self) -> Self;
}

/// What every processor can do; the compiler chooses the instructions.
#[derive(Clone, Copy)]
pub(super) struct Portable([f64; LANES]);

/// See [`Portable`].
#[derive(Clone, Copy)]
pub(super) struct PortableBits([u64; LANES]);

/// Implements operators of [`Portable`] lane by lane.
macro_rules! portable_operators {
    ($($name:ident $function:ident $operator:tt),*) => {$(
        impl $name for Portable {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(std::array::from_fn(|lane| self.0[lane] $operator other.0[lane]))
            }
        }
    )*};
}

portable_operators!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Lanes for Portable {
    type Bits = PortableBits;

    #[inline(always)]
    fn all(number: f64) -> Self {
        Self([number; LANES])
    }

    #[inline(always)]
    fn load(row: &Row) -> Self {
        Self(row.0)
    }

    #[inline(always)]
    fn row(self) -> Row {
        Row(self.0)
    }

    #[inline(always)]
    fn multiply_add(self, y: Self, z: Self) -> Self {
        self * y + z
    }

    #[inline(always)]
    fn negated_multiply_add(self, y: Self, z: Self) -> Self {
        z - self * y
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| if self.0[lane] > other.0[lane] { self.0[lane] } else { other.0[lane] }))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| if self.0[lane] < other.0[lane] { self.0[lane] } else { other.0[lane] }))
    }

    #[inline(always)]
    #[allow(clippy::neg_cmp_op_on_partial_ord, reason = "what is not a number counts as above")]
    fn any_above(self, limit: f64) -> bool {
        self.0.iter().any(|number| !(*number <= limit))
    }

    #[inline(always)]
    fn wrapped_up_from(self, least: f64) -> Self {
        Self(self.0.map(|number| if number <= least { -least } else { number }))
    }

    #[inline(always)]
    fn bits(self) -> PortableBits {
        PortableBits(self.0.map(f64::to_bits))
    }

    #[inline(always)]
    fn from_bits(bits: PortableBits) -> Self {
        Self(bits.0.map(f64::from_bits))
    }

    #[inline(always)]
    fn or_if_odd(self, odd: Self, quadrant: PortableBits) -> Self {
        Self(std::array::from_fn(|lane| if quadrant.0[lane] & 1 == 1 { odd.0[lane] } else { self.0[lane] }))
    }

    #[inline(always)]
    fn transposed(rows: [Self; LANES]) -> [Self; LANES] {
        std::array::from_fn(|column| Self(std::array::from_fn(|row| rows[row].0[column])))
    }
}

impl Bits for PortableBits {
    #[inline(always)]
    fn all(number: u64) -> Self {
        Self([number; LANES])
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane].wrapping_add(other.0[lane])))
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane].wrapping_sub(other.0[lane])))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] & other.0[lane]))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] | other.0[lane]))
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] ^ other.0[lane]))
    }

    #[inline(always)]
    fn up<const N: i32>(self) -> Self {
        Self(self.0.map(|bits| bits << N))
    }

    #[inline(always)]
    fn down<const N: i32>(self) -> Self {
        Self(self.0.map(|bits| bits >> N))
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2 {
    //! 256-bit registers with fused multiply-add. The solvers make these types only within a function compiled for
    //! AVX2 and FMA, which is called only where the processor was found to have both: that is the safety of every
    //! block in here.
    #![allow(clippy::undocumented_unsafe_blocks, reason = "one reason for all, in the module's first lines")]

    use std::arch::x86_64::*;
    use std::ops::{Add, Div, Mul, Sub};

    use super::{Bits, LANES, Lanes, Row};

    /// Four doubles.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256d);

    /// Four numbers of 64 bits.
    #[derive(Clone, Copy)]
    pub struct Avx2Bits(__m256i);

    macro_rules! avx2_operators {
        ($($name:ident $function:ident $instruction:ident),*) => {$(
            impl $name for Avx2 {
                type Output = Self;
                #[inline(always)]
                fn $function(self, other: Self) -> Self {
                    Self(unsafe { $instruction(self.0, other.0) })
                }
            }
        )*};
    }

    avx2_operators!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

    impl Lanes for Avx2 {
        type Bits = Avx2Bits;

        #[inline(always)]
        fn all(number: f64) -> Self {
            Self(unsafe { _mm256_set1_pd(number) })
        }

        #[inline(always)]
        fn load(row: &Row) -> Self {
            // A row is as long as a register and aligned to its length.
            Self(unsafe { _mm256_load_pd(row.0.as_ptr()) })
        }

        #[inline(always)]
        fn row(self) -> Row {
            let mut row = Row::ZERO;
            // As above.
            unsafe { _mm256_store_pd(row.0.as_mut_ptr(), self.0) };
            row
        }

        #[inline(always)]
        fn multiply_add(self, y: Self, z: Self) -> Self {
            Self(unsafe { _mm256_fmadd_pd(self.0, y.0, z.0) })
        }

        #[inline(always)]
        fn negated_multiply_add(self, y: Self, z: Self) -> Self {
            Self(unsafe { _mm256_fnmadd_pd(self.0, y.0, z.0) })
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            Self(unsafe { _mm256_sqrt_pd(self.0) })
        }

        #[inline(always)]
        fn abs(self) -> Self {
            Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            Self(unsafe { _mm256_max_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            Self(unsafe { _mm256_min_pd(self.0, other.0) })
        }

        #[inline(always)]
        fn any_above(self, limit: f64) -> bool {
            unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_NLE_UQ>(self.0, _mm256_set1_pd(limit))) != 0 }
        }

        #[inline(always)]
        fn wrapped_up_from(self, least: f64) -> Self {
            unsafe {
                let wrapped = _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, _mm256_set1_pd(least));
                Self(_mm256_blendv_pd(self.0, _mm256_set1_pd(-least), wrapped))
            }
        }

        #[inline(always)]
        fn bits(self) -> Avx2Bits {
            Avx2Bits(unsafe { _mm256_castpd_si256(self.0) })
        }

        #[inline(always)]
        fn from_bits(bits: Avx2Bits) -> Self {
            Self(unsafe { _mm256_castsi256_pd(bits.0) })
        }

        #[inline(always)]
        fn or_if_odd(self, odd: Self, quadrant: Avx2Bits) -> Self {
            // The instruction looks at the highest bit.
            Self(unsafe { _mm256_blendv_pd(self.0, odd.0, _mm256_castsi256_pd(quadrant.up::<63>().0)) })
        }

        #[inline(always)]
        fn transposed([a, b, c, d]: [Self; LANES]) -> [Self; LANES] {
            unsafe {
                let (ab_even, ab_odd) = (_mm256_unpacklo_pd(a.0, b.0), _mm256_unpackhi_pd(a.0, b.0));
                let (cd_even, cd_odd) = (_mm256_unpacklo_pd(c.0, d.0), _mm256_unpackhi_pd(c.0, d.0));
                [
                    Self(_mm256_permute2f128_pd::<0x20>(ab_even, cd_even)),
                    Self(_mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd)),
                    Self(_mm256_permute2f128_pd::<0x31>(ab_even, cd_even)),
                    Self(_mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd)),
                ]
            }
        }
    }

    impl Bits for Avx2Bits {
        #[inline(always)]
        fn all(number: u64) -> Self {
            Self(unsafe { _mm256_set1_epi64x(number.cast_signed()) })
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Self(unsafe { _mm256_add_epi64(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Self(unsafe { _mm256_sub_epi64(self.0, other.0) })
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            Self(unsafe { _mm256_and_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn or(self, other: Self) -> Self {
            Self(unsafe { _mm256_or_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn xor(self, other: Self) -> Self {
            Self(unsafe { _mm256_xor_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn up<const N: i32>(self) -> Self {
            Self(unsafe { _mm256_slli_epi64::<N>(self.0) })
        }

        #[inline(always)]
        fn down<const N: i32>(self) -> Self {
            Self(unsafe { _mm256_srli_epi64::<N>(self.0) })
        }
    }
}
