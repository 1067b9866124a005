//! Commands on their way to the queue.

/// Commands that are recorded, but not submitted yet.
#[derive(Default)]
pub(super) struct Recording {
    pub(super) encoder: Option<wgpu::CommandEncoder>,
    /// Takes all dispatches until a command of another kind, because each pass costs time of the host.
    pub(super) pass: Option<wgpu::ComputePass<'static>>,
    /// Passes so far, and the work of their dispatches.
    pub(super) passes: usize,
    pub(super) work: u64,
    /// Buffers of the host's memory that the commands read.
    pub(super) uploads: Vec<wgpu::Buffer>,
}
