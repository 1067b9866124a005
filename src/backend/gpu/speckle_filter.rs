//! Regions too small to be trusted: see [`Stage::SpeckleFilter`](crate::backend::Stage::SpeckleFilter).
//!
//! Regions are found anew in every band, among its rows and so many around it that a region which leaves them is large enough.

use super::buffers::{Rows, with_halo};
use super::shader::Kernel;
use super::steps::{Bindings, Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::plan::Plan;
use std::ops::Range;

const SHADER: &str = include_str!("../../../shaders/speckle_filter.wgsl");
/// Pixels of a segment of a row.
const SEGMENT: u32 = 64;
/// Columns in which blocks of rows are joined in one go: it bounds the chains that the shader follows.
const JOINED_COLUMNS: u32 = 4096;

uniform! { halo: u32, span: u32, first_column: u32, columns: u32, size: u32 }

/// `runs`, `join`, `flatten`, `count` and `flag`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let job = |entry, loops| {
        let kernel = Kernel::new("speckle_filter", entry, SHADER).with("SEGMENT", SEGMENT);
        Job::new::<Uniform>(kernel, loops)
    };
    // The pixels on both sides of a border, or the segments of a row.
    let chain = (JOINED_COLUMNS as usize).max(plan.levels[0].width / SEGMENT as usize);
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
    let base = Uniform { halo, size: r.plan.method.refinement.speckle_size, ..Uniform::default() };
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
        let joined = || -> Bindings { vec![(1, b.optima.bind(&seen)), (3, found(parents, &seen))] };
        let segments = l.width.div_ceil(SEGMENT);
        let bindings = [
            (1, b.optima.bind(&seen)),
            (2, b.flags.bind(&seen)),
            (3, found(parents, &seen)),
            (4, found(sizes, &seen)),
        ];
        r.dispatch(runs, &base, seen.clone(), (segments, height), &bindings)?;
        if segments > 1 {
            r.dispatch(join, &base, seen.clone(), (segments - 1, height), &joined())?;
            r.dispatch(flatten, &base, seen.clone(), (l.width, height), &pointers())?;
        }
        for span in (0..).map(|k| 1 << k).take_while(|&span: &u32| span < height) {
            for first_column in (0..l.width).step_by(JOINED_COLUMNS as usize) {
                let columns = JOINED_COLUMNS.min(l.width - first_column);
                let borders = (height - span).div_ceil(2 * span);
                let own = Uniform { span, first_column, columns, ..base };
                r.dispatch(join, &own, seen.clone(), (columns, borders), &joined())?;
                r.dispatch(flatten, &base, seen.clone(), (l.width, height), &pointers())?;
            }
        }
        let sized = [(3, found(parents, &seen)), (4, found(sizes, &seen))];
        r.dispatch(count, &base, seen.clone(), (l.width, height), &sized)?;
        let bindings = [(2, b.flags.bind(&rows)), (3, found(parents, &seen)), (4, found(sizes, &seen))];
        let size = (l.width, rows.end - rows.start);
        r.dispatch(flag, &base, rows, size, &bindings)?;
    }
    Ok(())
}
