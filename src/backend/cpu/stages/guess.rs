//! Guesses: see [`crate::backend::Stage::Guess`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;
use crate::front::prior;
use crate::image::Plane;
use crate::stage::prior::LabelPrior;

pub(super) fn run<U: Units>(v: &mut Volumes<U>, level: usize) {
    let l = &v.plan.levels[level];
    v.priors.resize_with(v.plan.levels.len(), || Plane::filled(0, 0, LabelPrior::default()));
    v.priors[level] = if level == 0 {
        prior::guessed(&v.maps.disparity, &v.maps.validity, &v.priors[0], l)
    } else {
        prior::coarser(&v.priors[level - 1], l, v.plan.label_offset(level))
    };
}
