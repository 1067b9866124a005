//! Ties, and regions too small to be trusted: see [`Stage::SpeckleFilter`](crate::backend::Stage::SpeckleFilter).
//!
//! Regions are found anew in every band, among its rows and so many around it that a region which leaves them is large enough.

use super::rows::{Rows, with_halo};
use super::shader::Kernel;
use super::steps::{Bindings, Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/speckle_filter.wgsl");
/// Pixels of a segment of a row.
const SEGMENT: u32 = 64;
/// Pixels on one side of the borders along which blocks of rows are joined in one go: it bounds the chains that the shader
/// follows.
const JOINED_PIXELS: u32 = 4096;

uniform! { halo: u32, span: u32, blocks: u32, first_column: u32, columns: u32, size: u32 }

/// How many blocks of rows become one in one go, and in which columns: as many as the image's `width` leaves room for.
fn joined(width: u32) -> (u32, u32) {
    let fits = |blocks: &u32| width <= JOINED_PIXELS / (blocks - 1);
    let blocks = [8, 4].into_iter().find(fits).unwrap_or(2);
    (blocks, JOINED_PIXELS / (blocks - 1))
}

/// `runs`, `join`, `flatten`, `count` and `flag`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let job = |entry, loops| {
        let kernel = Kernel::new("speckle_filter", entry, SHADER).with("SEGMENT", SEGMENT);
        Job::new::<Uniform>(kernel, loops)
    };
    // The pixels on both sides of a border, or the segments of a row.
    let chain = (JOINED_PIXELS as usize).max(plan.levels[0].width / SEGMENT as usize);
    vec![
        job("runs", SEGMENT as usize),
        // Followed from two pixels.
        job("join", 4 * chain + 8),
        job("flatten", 2 * chain + 4),
        job("count", 0),
        job("flag", 0),
    ]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let [runs, join, flatten, count, flag] = &jobs(r.plan, 0)[..] else { unreachable!("five kernels") };
    let halo = r.plan.method.refinement.speckle_size;
    let size = r.plan.method.refinement.speckle_size;
    let (blocks, most_columns) = joined(l.width);
    let base = Uniform { halo, blocks, size, ..Uniform::default() };
    let (parents, sizes) = (&b.speckle_parents, &b.speckle_sizes);
    // What is found in a band goes to the first rows of the scratch maps.
    let found = |what: &Rows, seen: &Range<u32>| what.bind(&(0..seen.end - seen.start));
    let bands = r.map_bands(|rows| {
        let seen = with_halo(rows, halo, l.height);
        vec![(1, b.optima.bind(&seen)), (2, b.flags.bind(&seen)), (3, found(parents, &seen))]
    })?;
    for rows in bands {
        let seen = with_halo(&rows, halo, l.height);
        let height = seen.end - seen.start;
        let pointers = || -> Bindings { vec![(3, found(parents, &seen))] };
        let pairs = || -> Bindings { vec![(1, b.optima.bind(&seen)), (3, found(parents, &seen))] };
        let segments = l.width.div_ceil(SEGMENT);
        let bindings = [
            (1, b.optima.bind(&seen)),
            (2, b.flags.bind(&seen)),
            (3, found(parents, &seen)),
            (4, found(sizes, &seen)),
        ];
        r.dispatch(runs, &base, seen.clone(), (segments, height), &bindings)?;
        if segments > 1 {
            r.dispatch(join, &base, seen.clone(), (segments - 1, height), &pairs())?;
            r.dispatch(flatten, &base, seen.clone(), (l.width, height), &pointers())?;
        }
        for span in (0..).map(|k| blocks.pow(k)).take_while(|&span| span < height) {
            for first_column in (0..l.width).step_by(most_columns as usize) {
                let columns = most_columns.min(l.width - first_column);
                // The last blocks may have fewer borders; the shader leaves those out that are not there.
                let borders = height.div_ceil(blocks * span) * (blocks - 1);
                let own = Uniform { span, first_column, columns, ..base };
                r.dispatch(join, &own, seen.clone(), (columns, borders), &pairs())?;
                r.dispatch(flatten, &base, seen.clone(), (l.width, height), &pointers())?;
            }
        }
        let sized = [(3, found(parents, &seen)), (4, found(sizes, &seen))];
        r.dispatch(count, &base, seen.clone(), (l.width, height), &sized)?;
        let bindings = [
            (1, b.optima.bind(&rows)),
            (2, b.flags.bind(&rows)),
            (3, found(parents, &seen)),
            (4, found(sizes, &seen)),
        ];
        let size = (l.width, rows.end - rows.start);
        r.dispatch(flag, &base, rows, size, &bindings)?;
    }
    Ok(())
}
