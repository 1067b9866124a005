//! The weighted median: see [`Stage::Median`](crate::backend::Stage::Median).
//!
//! Floor, a pixel: 28 bytes moved; in each of up to nine passes 3,000 bytes asked for (the 105 places) and 2,500 operations.

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{Binding, with_halo};
use super::shader::Shader;
use crate::error::Result;
use crate::options::Median;
use crate::weights::MedianWeights;

shader! {
    "median"(plan, level) {
        radius: u32, column_bits: u32, row_bits: u32, scale: u32, doublings: u32, all: u32
    }
    main: Main { left, disparity, flags, space, smoothed } => kernel(&MedianWeights::of(&plan.method));
}

/// The kernel for a window with `weights`.
pub(super) fn kernel(weights: &MedianWeights) -> Kernel<Main> {
    over_window(Main::SHADER, weights, 0)
}

/// A `shader` that imports the weighted median and goes over a window with `weights` so many times `more`.
pub(super) fn over_window(shader: Shader, weights: &MedianWeights, more: usize) -> Kernel<Main> {
    // One pass, and one for every three bits of what the disparities of a window may span.
    let passes = 1 + 8 + more;
    let window = 2 * weights.radius + 1;
    let every = 1 + u32::from(weights.checkered);
    Kernel::of(shader, passes * (window + 1) * window + 8 + more).with("EVERY", every)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    record_as(r, kernel, &MedianWeights::of(&r.plan.method))
}

/// Records the `kernel` for a window with `weights` on the pixels that the median changes.
pub(super) fn record_as(
    r: &mut Recorder,
    kernel: fn(&MedianWeights) -> Kernel<Main>,
    weights: &MedianWeights,
) -> Result<()> {
    let median = r.plan.method.refinement.median;
    if median == Median::Off {
        return Ok(());
    }
    smooth(r, &kernel(weights), weights, &r.buffers.median_weights, median == Median::All)
}

/// Records `kernel` with `weights`, whose spatial part `table` holds, on `all` pixels or on the filled ones.
pub(super) fn smooth(
    r: &mut Recorder,
    kernel: &Kernel<Main>,
    weights: &MedianWeights,
    table: &wgpu::Buffer,
    all: bool,
) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let [column_bits, row_bits] = weights.step_bits;
    let own = Uniform {
        radius: weights.radius as u32,
        column_bits,
        row_bits,
        scale: weights.scale,
        doublings: weights.doublings,
        all: all.into(),
    };
    let reach = own.radius << own.row_bits;
    r.rows(kernel, &own, l.width, |rows| {
        let seen = with_halo(rows, reach, l.height);
        Main {
            left: b.left.bind(&seen),
            disparity: b.disparity.bind(&seen),
            flags: b.flags.bind(&seen),
            space: Binding::whole(table),
            smoothed: b.spare_disparity.bind(rows),
        }
    })?;
    r.copies(b.spare_disparity.copy_to(&b.disparity));
    Ok(())
}
