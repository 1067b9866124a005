//! Guesses: see [`Stage::Guess`](crate::backend::Stage::Guess).
//!
//! Lower bound for a pixel: 16 bytes moved at level 0, and 10 more at each coarser one.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::LevelParams;
use crate::error::Result;
use crate::plan::{PRIOR_LABEL_BITS, PRIOR_SLOPE_MOST};
use crate::stage::guess::{GUESS_CAP, GUESS_FADE, GUESS_SLOPE};

shader! {
    "guess"(plan, level) { fine: LevelParams, label_offset: i32 }
    take { disparity, flags, prior } if level == 0 && !plan.prior => variant(0);
    take_unknown { disparity, flags, prior } if level == 0 && plan.prior => variant(0);
    pool { fine_prior, coarse_prior as prior } if level > 0 => variant(4);
}

fn variant(loops: usize) -> Variant {
    Variant::new(loops)
        .with("PRIOR_LABEL_BITS", PRIOR_LABEL_BITS)
        .with("PRIOR_SLOPE_MOST", PRIOR_SLOPE_MOST)
        .with("GUESS_CAP", u32::from(GUESS_CAP))
        .with("GUESS_FADE", u32::from(GUESS_FADE))
        .with("GUESS_SLOPE", GUESS_SLOPE)
}

pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let (plan, z, width) = (r.plan, r.level, r.params().width);
    if z == 0 {
        let kernel = if plan.prior { take_unknown(plan, 0) } else { take(plan, 0) };
        return r.rows(&kernel, &Uniform::default(), width);
    }
    let own = Uniform { fine: r.buffers.levels[z - 1], label_offset: plan.label_offset(z) };
    r.rows(&pool(plan, z), &own, width)
}
