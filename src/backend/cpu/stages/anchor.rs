//! Anchors: see [`crate::backend::Stage::Anchor`].

use crate::image::Pair;
use crate::maps::flag;
use crate::plan::Plan;
use crate::stage::anchor::ANCHOR_CONFIDENCE;
use crate::stage::{MapSet, NO_ANCHOR};

pub(super) fn run(maps: &mut MapSet, _: &Plan, _: &Pair) {
    let MapSet { anchors, disparity, validity, confidence, .. } = maps;
    let pixels = disparity.data_mut().iter_mut().zip(validity.data_mut()).zip(confidence.data_mut());
    for (((disparity, flags), confidence), &anchor) in pixels.zip(anchors.data()) {
        if *flags & flag::INVALID != 0 && *flags & flag::MASKED == 0 && anchor != NO_ANCHOR {
            (*disparity, *flags, *confidence) = (anchor, flag::FILLED, ANCHOR_CONFIDENCE);
        }
    }
}
