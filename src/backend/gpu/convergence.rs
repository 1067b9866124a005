//! The convergence of the label map on a device.

use bytemuck::{Pod, Zeroable};

/// The state of [`Stage::Change`](crate::backend::Stage::Change) in its shader.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Convergence {
    sum: [u32; 2],
    runs: u32,
    /// 1 once the map has settled.
    pub(super) settled: u32,
    /// Number of iterations after the map had settled.
    pub(super) idle: u32,
}

impl Convergence {
    /// Decodes the words of the shader's state.
    pub(super) fn of(words: &[u32]) -> Self {
        *bytemuck::from_bytes(&bytemuck::cast_slice(words)[..size_of::<Self>()])
    }

    /// The last sum of squared changes.
    pub(super) fn sum(self) -> u64 {
        u64::from(self.sum[1]) << 32 | u64::from(self.sum[0])
    }
}
