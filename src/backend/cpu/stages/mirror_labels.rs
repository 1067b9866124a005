//! The labels of the mirrored pair: see [`crate::backend::Stage::MirrorLabels`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    let maps = &mut v.maps;
    (maps.right, maps.right_best) =
        (maps.optima.map(|o| o.label).mirrored(), maps.optima.map(|o| o.best).mirrored());
}
