//! One iteration within a level: see [`Stage::Flood`](crate::backend::Stage::Flood).
//!
//! A device processes all pixels at once, so it gains nothing from computing messages and beliefs together:
//! the stage has no shader of its own.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::Kernel;
use crate::error::Result;
use crate::plan::Plan;

pub(super) fn kernels(_: &Plan, _: usize) -> Vec<Kernel> {
    Vec::new()
}

#[allow(clippy::unnecessary_wraps, reason = "every stage has this function")]
pub(super) fn record(_: &mut Recorder) -> Result<()> {
    Ok(())
}
