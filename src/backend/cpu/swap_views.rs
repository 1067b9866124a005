//! The right view in place of the left one: see [`crate::backend::Stage::SwapViews`].

use super::finest::{Finest, Optimum};
use super::units::Units;
use super::volumes::Volumes;
use crate::backend::volume::NO_RUNNER_UP;
use std::mem;

pub(super) fn run<U: Units>(v: &mut Volumes<U>) {
    v.pair = v.pair.mirrored();
    v.maps.swap_views();
}

impl Finest {
    /// Exchanges the labels of the two views, mirrored.
    pub(crate) fn swap_views(&mut self) {
        let Self { optima, right, right_best, .. } = self;
        let width = optima.width();
        let rows = optima.data_mut().chunks_exact_mut(width).zip(right.data_mut().chunks_exact_mut(width));
        for ((optima, labels), best) in rows.zip(right_best.data_mut().chunks_exact_mut(width)) {
            for ((optimum, label), best) in optima.iter_mut().zip(labels.iter_mut()).zip(best.iter_mut()) {
                let right = Optimum { label: *label, best: *best, runner_up: NO_RUNNER_UP };
                let left = mem::replace(optimum, right);
                (*label, *best) = (left.label, left.best);
            }
            optima.reverse();
            labels.reverse();
            best.reverse();
        }
    }
}
