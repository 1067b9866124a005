//! Fills invalid pixels: see [`Stage::Fill`](crate::backend::Stage::Fill).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::options::Nearer;
use crate::stage::Map;

shader! {
    "fill"(plan, level) { source_first_row: u32, source_rows: u32, farther_is_larger: u32 }
    rows { flags, known_rows } => Variant::new(plan.levels[0].width);
    sources { known_rows, row_sources } => Variant::new(plan.levels[0].height);
    fill {
        disparity, flags, source_disparity, source_flags, next_disparity, next_flags, row_sources
    } => Variant::new(plan.levels[0].width);
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, l) = (r.plan, r.params());
    let none = Uniform::default();
    r.one_a_row(&rows(plan, 0), &none)?;
    r.dispatch(&sources(plan, 0), &none, 0..l.height, (l.height, 1))?;
    // A row may take its values from any other, so each band is filled from every band.
    for source in r.bands_of(&[(&fill(plan, 0).any(), 0)], usize::MAX)? {
        let own = Uniform {
            source_first_row: source.start,
            source_rows: source.end - source.start,
            farther_is_larger: (plan.method.refinement.nearer == Nearer::Smaller).into(),
        };
        r.source = Some(source);
        r.rows(&fill(plan, 0), &own, l.width)?;
    }
    r.source = None;
    r.exchange(Map::Disparity);
    r.exchange(Map::Validity);
    Ok(())
}
