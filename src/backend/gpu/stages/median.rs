//! The weighted median: see [`Stage::Median`](crate::backend::Stage::Median).
//!
//! Lower bound per pixel: 28 bytes moved; in up to nine passes 3,000 bytes requested (105 places), 2,500 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Kernel, Variant};
use crate::backend::gpu::shader::Shader;
use crate::backend::gpu::uniform::layout;
use crate::error::Result;
use crate::options::Median;
use crate::plan::Plan;
use crate::stage::Map;
use crate::weights::MedianWeights;

layout! {
    Uniform {
        radius: u32,
        column_bits: u32,
        row_bits: u32,
        scale: u32,
        doublings: u32,
        all: u32,
    }
}

const SHADER: Shader = Shader::new("median", "main", include_str!("../../../../shaders/median.wgsl"));

/// The kernel for a window with `weights`.
pub(super) fn kernel(weights: &MedianWeights) -> Kernel<Uniform> {
    over_window(SHADER, weights, 0, |variant| variant)
}

pub(super) fn kernels(plan: &Plan, _: usize) -> Vec<Kernel> {
    vec![kernel(&MedianWeights::of(&plan.method)).any()]
}

/// The kernel of a `shader` with the weighted median and `more` extra passes over a window with `weights`.
pub(super) fn over_window(
    shader: Shader,
    weights: &MedianWeights,
    more: usize,
    specialised: impl Fn(Variant) -> Variant,
) -> Kernel<Uniform> {
    // One pass, and one for every three bits of the range of disparities in a window.
    let passes = 1 + 8 + more;
    let window = 2 * weights.radius + 1;
    let every = 1 + u32::from(weights.checkered);
    let variant = Variant::new(passes * (window + 1) * window + 8 + more).with("EVERY", every);
    let reach = (weights.radius as u32) << weights.step_bits[1];
    let bound =
        [("left", reach), ("disparity", reach), ("flags", reach), ("space", 0), ("next_disparity", 0)];
    Kernel::new(shader, bound.to_vec(), specialised(variant)).taking("space", "median_weights")
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    record_as(r, kernel, &MedianWeights::of(&r.plan.method))
}

/// Records the `kernel` for a window with `weights` on the pixels that the median changes.
pub(super) fn record_as(
    r: &mut Recorder,
    kernel: fn(&MedianWeights) -> Kernel<Uniform>,
    weights: &MedianWeights,
) -> Result<()> {
    let median = r.plan.method.refinement.median;
    if median == Median::Off {
        return Ok(());
    }
    smooth(r, &kernel(weights), weights, median == Median::All)
}

/// Records `kernel` with `weights` on `all` pixels or on the filled ones.
pub(super) fn smooth(
    r: &mut Recorder,
    kernel: &Kernel<Uniform>,
    weights: &MedianWeights,
    all: bool,
) -> Result<()> {
    let [column_bits, row_bits] = weights.step_bits;
    let own = Uniform {
        radius: weights.radius as u32,
        column_bits,
        row_bits,
        scale: weights.scale,
        doublings: weights.doublings,
        all: all.into(),
    };
    let width = r.params().width;
    r.rows(kernel, &own, width)?;
    r.exchange(Map::Disparity);
    Ok(())
}
