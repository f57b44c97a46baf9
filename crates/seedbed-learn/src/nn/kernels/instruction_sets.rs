//! Operations with each instruction set of this processor, for tests that compare their bits.

use pulp::{Arch, Scalar, WithSimd};

/// Instruction sets that operations are compiled for.
#[derive(Clone, Copy, Debug)]
pub(super) enum InstructionSet {
    /// No SIMD.
    Scalar,
    /// AVX2 and FMA, where the processor has them; otherwise the best.
    V3,
    /// The best that the processor has, such as AVX-512.
    Best,
}

impl InstructionSet {
    /// All but [`Scalar`](Self::Scalar), with which they are compared.
    pub(super) const WITH_SIMD: [Self; 2] = [Self::V3, Self::Best];

    pub(super) fn run<O: WithSimd>(self, operation: O) -> O::Output {
        match self {
            Self::Scalar => operation.with_simd(Scalar),
            #[cfg(target_arch = "x86_64")]
            Self::V3 if let Some(simd) = pulp::x86::V3::try_new() => {
                Arch::V3(simd).dispatch(operation)
            }
            Self::V3 | Self::Best => Arch::new().dispatch(operation),
        }
    }
}
