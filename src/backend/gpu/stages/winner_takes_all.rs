//! The optimum of each pixel's beliefs: see [`Stage::WinnerTakesAll`](crate::backend::Stage::WinnerTakesAll).
//!
//! Lower bound for four labels: 4 bytes moved, 8 requested (again for the runner-up), 15 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::stage::NO_RUNNER_UP;

shader! {
    "winner_takes_all"(plan, level) {}
    main { belief, optima, windows } => Variant::new(2 * plan.levels[0].quads())
        .of_width(plan.volume_width)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
