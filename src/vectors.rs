//! The vector instructions that inner loops are compiled for.

/// The widest ones of this machine, of those that the loops are compiled for.
///
/// In a browser all of the library is compiled for the one kind there is. A second copy of each loop would only take longer to load.
#[inline(always)]
pub(crate) fn widest() -> pulp::Arch {
    if cfg!(all(target_arch = "wasm32", target_feature = "simd128")) {
        pulp::Arch::Scalar
    } else {
        pulp::Arch::new()
    }
}
