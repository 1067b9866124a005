//! Disparities for what is invalid: see [`Stage::Fill`](crate::backend::Stage::Fill).

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use super::rows::Binding;
use crate::error::Result;
use crate::options::Nearer;

shader! {
    "fill"(plan, level) { source_first_row: u32, source_rows: u32, farther_is_larger: u32 }
    rows: KnownRows { flags, is_known } => Kernel::new(plan.levels[0].width);
    sources: Sources { is_known, source_of } => Kernel::new(plan.levels[0].height);
    fill: Fill {
        disparity, flags, source_disparity, source_flags, filled_disparity, filled_flags, source_of
    } => Kernel::new(plan.levels[0].width);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, l) = (r.buffers, r.params());
    let [is_known, source_of] = [&b.filled_rows, &b.source_rows].map(Binding::whole);
    let none = Uniform::default();
    r.one_a_row(&rows(r.plan, 0), &none, |rows| KnownRows {
        flags: b.flags.bind(rows),
        is_known: is_known.clone(),
    })?;
    let tables = Sources { is_known, source_of: source_of.clone() };
    r.dispatch(&sources(r.plan, 0), &none, 0..l.height, (l.height, 1), tables)?;
    // A row may take its values from any other: every band from every band.
    for source in r.map_bands(&|rows| vec![b.flags.bind(rows)])? {
        let own = Uniform {
            source_first_row: source.start,
            source_rows: source.end - source.start,
            farther_is_larger: (r.plan.method.refinement.nearer == Nearer::Smaller).into(),
        };
        r.rows(&fill(r.plan, 0), &own, l.width, |rows| Fill {
            disparity: b.disparity.bind(rows),
            flags: b.flags.bind(rows),
            source_disparity: b.disparity.bind(&source),
            source_flags: b.flags.bind(&source),
            filled_disparity: b.spare_disparity.bind(rows),
            filled_flags: b.spare_flags.bind(rows),
            source_of: source_of.clone(),
        })?;
    }
    r.copies(b.spare_disparity.copy_to(&b.disparity));
    r.copies(b.spare_flags.copy_to(&b.flags));
    Ok(())
}
