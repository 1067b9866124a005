//! Whether the label map has settled, as a device finds it.

use bytemuck::{Pod, Zeroable};

/// What [`Stage::Change`](crate::backend::Stage::Change) has found so far, as its shader keeps it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Convergence {
    sum: [u32; 2],
    runs: u32,
    /// 1 once it has.
    pub(super) settled: u32,
    /// How often the map had settled before.
    pub(super) idle: u32,
}

impl Convergence {
    /// What these words say.
    pub(super) fn of(words: &[u32]) -> Self {
        *bytemuck::from_bytes(&bytemuck::cast_slice(words)[..size_of::<Self>()])
    }

    /// The last sum of squared changes.
    pub(super) fn sum(self) -> u64 {
        u64::from(self.sum[1]) << 32 | u64::from(self.sum[0])
    }
}
