//! The lead of each label without the pixel's own guess: see [`Stage::Lead`](crate::backend::Stage::Lead).
//!
//! Lower bound for a pixel: 16 bytes moved, and for four labels 4 more where there is a guess, 60 operations.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::plan::{PRIOR_LABEL_BITS, PRIOR_REACH, PRIOR_SLOPE_BITS};
use crate::stage::NO_RUNNER_UP;
use crate::stage::guess::GUESS_CAP;

shader! {
    "lead"(plan, level) {}
    main { belief, optima, windows, prior } => Variant::new(plan.levels[0].quads())
        .of_width(plan.volume_width)
        .with("NO_RUNNER_UP", u32::from(NO_RUNNER_UP))
        .with("PRIOR_LABEL_BITS", PRIOR_LABEL_BITS)
        .with("PRIOR_SLOPE_BITS", PRIOR_SLOPE_BITS)
        .with("PRIOR_REACH", PRIOR_REACH)
        .with("GUESS_CAP", u32::from(GUESS_CAP));
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let width = r.params().width;
    r.rows(&main(r.plan, 0), &Uniform {}, width)
}
