//! Ties, and regions too small to be trusted: see [`Stage::SpeckleFilter`](crate::backend::Stage::SpeckleFilter).
//!
//! Regions are found anew in every band, among its rows and so many around it that a region which leaves them is large enough.

use super::commands::Recorder;
use super::kernel::{Bindings, Kernel, shader};
use super::rows::{Rows, with_halo};
use crate::error::Result;
use crate::plan::Plan;
use std::ops::Range;

/// Pixels of a segment of a row.
const SEGMENT: u32 = 64;
/// Pixels on one side of the borders along which blocks of rows are joined in one go: it bounds the chains that the shader
/// follows.
const JOINED_PIXELS: u32 = 4096;

shader! {
    "speckle_filter"(plan, level) {
        halo: u32, span: u32, blocks: u32, first_column: u32, columns: u32, size: u32
    }
    runs: Runs { optima, flags, parents, sizes } => kernel(SEGMENT as usize);
    // Followed from two pixels.
    join: Join { optima, parents } => kernel(4 * chain(plan) + 8);
    flatten: Flatten { parents } => kernel(2 * chain(plan) + 4);
    count: Count { parents, sizes } => kernel(0);
    flag: Flag { optima, flags, parents, sizes } => kernel(0);
}

fn kernel<B: Bindings>(loops: usize) -> Kernel<B> {
    Kernel::new(loops).with("SEGMENT", SEGMENT)
}

/// The longest chain: the pixels on both sides of a border, or the segments of a row.
fn chain(plan: &Plan) -> usize {
    (JOINED_PIXELS as usize).max(plan.levels[0].width / SEGMENT as usize)
}

/// How many blocks of rows become one in one go, and in which columns: as many as the image's `width` leaves room for.
fn joined(width: u32) -> (u32, u32) {
    let fits = |blocks: &u32| width <= JOINED_PIXELS / (blocks - 1);
    let blocks = [8, 4].into_iter().find(fits).unwrap_or(2);
    (blocks, JOINED_PIXELS / (blocks - 1))
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l, plan) = (r.buffers, r.params(), r.plan);
    let (join, flatten) = (join(plan, 0), flatten(plan, 0));
    let size = plan.method.refinement.speckle_size;
    let (blocks, most_columns) = joined(l.width);
    let base = Uniform { halo: size, blocks, size, ..Uniform::default() };
    // What is found in a band goes to the first rows of the scratch maps.
    let found = |what: &Rows, seen: &Range<u32>| what.bind(&(0..seen.end - seen.start));
    let bands = r.map_bands(&|rows| {
        let seen = with_halo(rows, size, l.height);
        vec![b.optima.bind(&seen), b.flags.bind(&seen), found(&b.speckle_parents, &seen)]
    })?;
    for rows in bands {
        let seen = with_halo(&rows, size, l.height);
        let height = seen.end - seen.start;
        let (optima, flags) = (b.optima.bind(&seen), b.flags.bind(&seen));
        let (parents, sizes) = (found(&b.speckle_parents, &seen), found(&b.speckle_sizes, &seen));
        let pairs = || Join { optima: optima.clone(), parents: parents.clone() };
        let pointers = || Flatten { parents: parents.clone() };
        let segments = l.width.div_ceil(SEGMENT);
        let all = Runs { optima: optima.clone(), flags, parents: parents.clone(), sizes: sizes.clone() };
        r.dispatch(&runs(plan, 0), &base, seen.clone(), (segments, height), all)?;
        if segments > 1 {
            r.dispatch(&join, &base, seen.clone(), (segments - 1, height), pairs())?;
            r.dispatch(&flatten, &base, seen.clone(), (l.width, height), pointers())?;
        }
        for span in (0..).map(|k| blocks.pow(k)).take_while(|&span| span < height) {
            for first_column in (0..l.width).step_by(most_columns as usize) {
                let columns = most_columns.min(l.width - first_column);
                // The last blocks may have fewer borders; the shader leaves those out that are not there.
                let borders = height.div_ceil(blocks * span) * (blocks - 1);
                let own = Uniform { span, first_column, columns, ..base };
                r.dispatch(&join, &own, seen.clone(), (columns, borders), pairs())?;
                r.dispatch(&flatten, &base, seen.clone(), (l.width, height), pointers())?;
            }
        }
        let sized = Count { parents: parents.clone(), sizes: sizes.clone() };
        r.dispatch(&count(plan, 0), &base, seen, (l.width, height), sized)?;
        let flagged = Flag { optima: b.optima.bind(&rows), flags: b.flags.bind(&rows), parents, sizes };
        let size = (l.width, rows.end - rows.start);
        r.dispatch(&flag(plan, 0), &base, rows, size, flagged)?;
    }
    Ok(())
}
