//! Exchanges the views: see [`crate::backend::Stage::SwapViews`].

use crate::backend::cpu::units::Units;
use crate::backend::cpu::volumes::Volumes;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    v.pair = v.pair.mirrored();
    v.maps.swap_views();
}
