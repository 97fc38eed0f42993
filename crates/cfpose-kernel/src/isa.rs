//! Choice of the instruction set at run time.

use pulp::{Simd, WithSimd};

/// An instruction set that this machine has.
///
/// Results are reproducible to the bit for one `Isa`; between instruction sets sums differ in the last digits, because
/// partial sums are as many as there are lanes.
///
/// ```
/// use cfpose_kernel::Isa;
/// assert!(Isa::available().contains(&Isa::detect()));
/// assert_eq!(Isa::by_name("baseline"), Some(Isa::baseline()));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Isa(Kind);

/// The token inside proves that the processor has the instructions, so dispatch needs no check and no `unsafe`.
#[derive(Debug, Clone, Copy)]
enum Kind {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Baseline,
}

impl Isa {
    /// Return the widest instruction set of this machine.
    pub fn detect() -> Self {
        Self::available()[0]
    }

    /// Return the instruction set without vectors, available everywhere.
    pub fn baseline() -> Self {
        Self(Kind::Baseline)
    }

    /// Return all instruction sets of this machine, widest first.
    pub fn available() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(pulp::x86::V4::try_new().map(|token| Self(Kind::Avx512(token))));
            all.extend(pulp::x86::V3::try_new().map(|token| Self(Kind::Avx2(token))));
        }
        all.push(Self::baseline());
        all
    }

    /// Return the name used on the command line and in results: `avx512`, `avx2` or `baseline`.
    pub fn name(self) -> &'static str {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "avx512",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "avx2",
            Kind::Baseline => "baseline",
        }
    }

    /// Find an available instruction set by name; `auto` is the widest.
    pub fn by_name(name: &str) -> Option<Self> {
        if name == "auto" {
            return Some(Self::detect());
        }
        Self::available().into_iter().find(|isa| isa.name() == name)
    }

    /// Return the number of `f64` lanes of one vector.
    pub fn lanes(self) -> usize {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => <pulp::x86::V4 as Simd>::F64_LANES,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => <pulp::x86::V3 as Simd>::F64_LANES,
            Kind::Baseline => 1,
        }
    }

    /// Run an operation compiled for this instruction set.
    #[inline]
    pub fn run<Op: WithSimd>(self, operation: Op) -> Op::Output {
        match self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(token) => Simd::vectorize(token, operation),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(token) => Simd::vectorize(token, operation),
            Kind::Baseline => Simd::vectorize(pulp::Scalar, operation),
        }
    }
}

impl PartialEq for Isa {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Isa {}

impl Default for Isa {
    fn default() -> Self {
        Self::detect()
    }
}
