//! Disparities for what is invalid: see [`Stage::Fill`](crate::backend::Stage::Fill).

use super::rows::Binding;
use super::shader::Kernel;
use super::steps::{Job, Recorder};
use super::uniform::uniform;
use crate::error::Result;
use crate::options::Nearer;
use crate::plan::Plan;

const SHADER: &str = include_str!("../../../shaders/fill.wgsl");

uniform! { source_first_row: u32, source_rows: u32, farther_is_larger: u32 }

/// `rows`, `sources` and `fill`.
pub(super) fn jobs(plan: &Plan, _: usize) -> Vec<Job> {
    let job = |entry, loops| Job::new::<Uniform>(Kernel::new("fill", entry, SHADER), loops);
    let level = &plan.levels[0];
    vec![job("rows", level.width), job("sources", level.height), job("fill", level.width)]
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let [rows, sources, fill] = &jobs(r.plan, 0)[..] else { unreachable!("three kernels") };
    let none = Uniform::default();
    r.one_a_row(rows, &none, |rows| vec![(2, b.flags.bind(rows)), (7, Binding::whole(&b.filled_rows))])?;
    let tables = [(7, Binding::whole(&b.filled_rows)), (8, Binding::whole(&b.source_rows))];
    r.dispatch(sources, &none, 0..l.height, (l.height, 1), &tables)?;
    // A row may take its values from any other: every band from every band.
    for source in r.map_bands(|rows| vec![(2, b.flags.bind(rows))])? {
        let own = Uniform {
            source_first_row: source.start,
            source_rows: source.end - source.start,
            farther_is_larger: (r.plan.method.refinement.nearer == Nearer::Smaller).into(),
        };
        r.rows(fill, &own, l.width, |rows| {
            vec![
                (1, b.disparity.bind(rows)),
                (2, b.flags.bind(rows)),
                (3, b.disparity.bind(&source)),
                (4, b.flags.bind(&source)),
                (5, b.spare_disparity.bind(rows)),
                (6, b.spare_flags.bind(rows)),
                (8, Binding::whole(&b.source_rows)),
            ]
        })?;
    }
    r.copies(b.spare_disparity.copy_to(&b.disparity));
    r.copies(b.spare_flags.copy_to(&b.flags));
    Ok(())
}
