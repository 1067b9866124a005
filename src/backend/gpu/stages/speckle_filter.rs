//! Flags ties and small regions: see [`Stage::SpeckleFilter`](crate::backend::Stage::SpeckleFilter).
//!
//! Regions are found separately for every band, in its rows and enough around it that a region which leaves them is large.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::rows::with_halo;
use crate::error::Result;
use crate::plan::Plan;

/// Pixels per segment of a row.
const SEGMENT: u32 = 64;
/// Pixels on one side of the borders along which blocks of rows are joined in one dispatch; bounds the length
/// of chains that the shader follows.
const JOINED_PIXELS: u32 = 4096;

shader! {
    "speckle_filter"(plan, level) {
        halo: u32, span: u32, blocks: u32, first_column: u32, columns: u32, size: u32
    }
    runs { optima, flags, parents, sizes } => variant(SEGMENT as usize);
    // Two chains are followed.
    join { optima, parents } => variant(4 * chain(plan) + 8);
    flatten { parents } => variant(2 * chain(plan) + 4);
    count { parents, sizes } => variant(0);
    flag { optima, flags, parents around size(plan), sizes around size(plan) } => variant(0);
}

fn variant(loops: usize) -> Variant {
    Variant::new(loops).with("SEGMENT", SEGMENT)
}

/// Number of rows around its own that a band reads.
fn size(plan: &Plan) -> u32 {
    plan.method.refinement.speckle_size
}

/// The longest chain: the pixels on both sides of a border, or the segments of a row.
fn chain(plan: &Plan) -> usize {
    (JOINED_PIXELS as usize).max(plan.levels[0].width / SEGMENT as usize)
}

/// (blocks of rows to join at a time, columns to join them in), limited by the `width` of the image.
fn joined(width: u32) -> (u32, u32) {
    let fits = |blocks: &u32| width <= JOINED_PIXELS / (blocks - 1);
    let blocks = [8, 4].into_iter().find(fits).unwrap_or(2);
    (blocks, JOINED_PIXELS / (blocks - 1))
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (l, plan) = (r.params(), r.plan);
    let (join, flatten) = (join(plan, 0), flatten(plan, 0));
    let size = size(plan);
    let (blocks, most_columns) = joined(l.width);
    let base = Uniform { halo: size, blocks, size, ..Uniform::default() };
    for rows in r.bands_of(&[(&runs(plan, 0).any(), size)], usize::MAX)? {
        let seen = with_halo(&rows, size, l.height);
        let height = seen.end - seen.start;
        let segments = l.width.div_ceil(SEGMENT);
        r.dispatch(&runs(plan, 0), &base, seen.clone(), (segments, height))?;
        if segments > 1 {
            r.dispatch(&join, &base, seen.clone(), (segments - 1, height))?;
            r.dispatch(&flatten, &base, seen.clone(), (l.width, height))?;
        }
        for span in (0..).map(|k| blocks.pow(k)).take_while(|&span| span < height) {
            for first_column in (0..l.width).step_by(most_columns as usize) {
                let columns = most_columns.min(l.width - first_column);
                // The last blocks may have fewer borders; the shader skips missing ones.
                let borders = height.div_ceil(blocks * span) * (blocks - 1);
                let own = Uniform { span, first_column, columns, ..base };
                r.dispatch(&join, &own, seen.clone(), (columns, borders))?;
                r.dispatch(&flatten, &base, seen.clone(), (l.width, height))?;
            }
        }
        r.dispatch(&count(plan, 0), &base, seen, (l.width, height))?;
        let size = (l.width, rows.end - rows.start);
        r.dispatch(&flag(plan, 0), &base, rows, size)?;
    }
    Ok(())
}
