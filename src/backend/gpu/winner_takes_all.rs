//! The optimum of every pixel: see [`Stage::WinnerTakesAll`](crate::backend::Stage::WinnerTakesAll).
//!
//! Floor, a label: 1 byte moved, 2 asked for (the beliefs again, for the runner-up), 15 operations for four.

use super::commands::Recorder;
use super::kernel::{Kernel, shader};
use crate::error::Result;
use crate::stage::NO_RUNNER_UP;

shader! {
    "winner_takes_all"(plan, level) {}
    main: Main { belief, optima, windows } => Kernel::new(2 * plan.levels[0].quads())
        .of_width(plan.volume_width)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (b, here, l) = (r.buffers, r.here(), r.params());
    r.rows(&main(r.plan, 0), &Uniform {}, l.width, |rows| Main {
        belief: here.belief.bind(rows),
        optima: b.optima.bind(rows),
        windows: here.windows.bind(&(0..1)),
    })
}
