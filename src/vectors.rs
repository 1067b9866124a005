//! The vector instructions that inner loops are compiled for.

/// The widest vector instructions of this machine that the loops are compiled for.
///
/// For browsers, the whole library is compiled for one instruction set. A second copy of each loop would only make it larger.
#[inline(always)]
pub(crate) fn widest() -> pulp::Arch {
    if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
        pulp::Arch::Scalar
    } else {
        pulp::Arch::new()
    }
}
