//! The weighted median: see [`Stage::Median`](crate::backend::Stage::Median).
//!
//! Floor, a pixel: 28 bytes moved; in each of up to nine passes 3,000 bytes asked for (the 105 places) and 2,500 operations.

use super::rows::{Binding, with_halo};
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::options::Median;
use crate::plan::Plan;
use crate::weights::MedianWeights;

const SHADER: &str = include_str!("../../../shaders/median.wgsl");

uniform! { radius: u32, column_bits: u32, row_bits: u32, scale: u32, doublings: u32, all: u32 }

pub(super) fn kernel() -> Kernel {
    Kernel::new("median", "main", SHADER)
}

/// A job for `kernel`, which imports the weighted median and goes over a window with `weights` so many times `more`.
pub(super) fn job(weights: &MedianWeights, kernel: Kernel, more: usize) -> Job {
    // One pass, and one for every three bits of what the disparities of a window may span.
    let passes = 1 + 8 + more;
    let window = 2 * weights.radius() + 1;
    Job::new::<Uniform>(kernel, passes * (window + 1) * window + 8 + more)
}

pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    vec![job(&MedianWeights::of(&plan.method), kernel(), 0)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let job = &jobs(r.plan, 0)[0];
    record_as(r, job)
}

/// Records `job` on the pixels that the median changes.
pub(super) fn record_as(r: &mut Recorder, job: &Job) -> Result<()> {
    let median = r.plan.method.refinement.median;
    if median == Median::Off {
        return Ok(());
    }
    smooth(r, job, &MedianWeights::of(&r.plan.method), &r.buffers.median_weights, median == Median::All)
}

/// Records `job` with `weights`, whose spatial part `table` holds, on `all` pixels or on the filled ones.
pub(super) fn smooth(
    r: &mut Recorder,
    job: &Job,
    weights: &MedianWeights,
    table: &wgpu::Buffer,
    all: bool,
) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let [column_bits, row_bits] = weights.step_bits();
    let own = Uniform {
        radius: weights.radius() as u32,
        column_bits,
        row_bits,
        scale: weights.scale(),
        doublings: weights.doublings(),
        all: all.into(),
    };
    let reach = own.radius << own.row_bits;
    r.rows(job, &own, l.width, |rows| {
        let seen = with_halo(rows, reach, l.height);
        vec![
            (1, b.left.bind(&seen)),
            (2, b.disparity.bind(&seen)),
            (3, b.flags.bind(&seen)),
            (4, Binding::whole(table)),
            (5, b.spare_disparity.bind(rows)),
        ]
    })?;
    r.copies(b.spare_disparity.copy_to(&b.disparity));
    Ok(())
}
