//! All maps of a match in progress, from the labels on.

use super::Map;
use super::map::{NO_ANCHOR, NO_RUNNER_UP};
use super::prior::{LabelPrior, LevelPriors};
use crate::image::{Plane, Rect};
use crate::maps::Maps;
use crate::plan::Plan;
use std::mem;

/// All maps of a match in progress.
pub(crate) struct MapSet {
    pub(crate) optima: Plane<Optimum>,
    pub(crate) right: Plane<u16>,
    /// Belief of the right labels.
    pub(crate) right_best: Plane<u16>,
    pub(crate) raw: Plane<i32>,
    pub(crate) disparity: Plane<i32>,
    pub(crate) validity: Plane<u8>,
    pub(crate) confidence: Plane<u8>,
    /// [`Map::Anchor`]; empty without a prior.
    pub(crate) anchors: Plane<i32>,
    /// The maps at full size, in whole blocks of 2 x 2 pixels; empty if the pair is matched at full size.
    pub(crate) full: Maps,
}

/// The optimum of the beliefs of one pixel, in units.
#[derive(Clone, Copy, Default)]
pub(crate) struct Optimum {
    pub(crate) label: u16,
    pub(crate) best: u16,
    pub(crate) runner_up: u16,
}

impl MapSet {
    pub(crate) fn new(plan: &Plan) -> Self {
        let (width, height) = plan.size();
        let (full_width, full_height) = if plan.full.is_some() { (2 * width, 2 * height) } else { (0, 0) };
        let full = Maps {
            disparity: Plane::filled(full_width, full_height, 0),
            raw: Plane::filled(full_width, full_height, 0),
            confidence: Plane::filled(full_width, full_height, 0),
            validity: Plane::filled(full_width, full_height, 0),
            right: None,
        };
        let anchored = if plan.prior { (width, height) } else { (0, 0) };
        Self {
            full,
            anchors: Plane::filled(anchored.0, anchored.1, NO_ANCHOR),
            optima: Plane::filled(width, height, Optimum::default()),
            right: Plane::filled(width, height, 0),
            right_best: Plane::filled(width, height, 0),
            raw: Plane::filled(width, height, 0),
            disparity: Plane::filled(width, height, 0),
            validity: Plane::filled(width, height, 0),
            confidence: Plane::filled(width, height, 0),
        }
    }

    /// The result of a match: the maps at `full` size, or at the size of the finest level.
    pub(crate) fn found(&self, full: bool) -> Maps {
        if full {
            return self.full.clone();
        }
        let Self { disparity, raw, confidence, validity, .. } = self;
        Maps {
            disparity: disparity.clone(),
            raw: raw.clone(),
            confidence: confidence.clone(),
            validity: validity.clone(),
            right: None,
        }
    }

    pub(crate) fn read(&self, map: Map) -> Plane<i32> {
        match map {
            Map::Label => self.optima.map(|p| p.label.into()),
            Map::Best => self.optima.map(|p| p.best.into()),
            Map::RunnerUp => self.optima.map(|p| p.runner_up.into()),
            Map::RightLabel => self.right.map(|&v| v.into()),
            Map::RightBest => self.right_best.map(|&v| v.into()),
            Map::Raw => self.raw.clone(),
            Map::Disparity => self.disparity.clone(),
            Map::Validity => self.validity.map(|&v| v.into()),
            Map::Confidence => self.confidence.map(|&v| v.into()),
            Map::Anchor => self.anchors.clone(),
            Map::FullRaw => self.full.raw.clone(),
            Map::FullDisparity => self.full.disparity.clone(),
            Map::FullValidity => self.full.validity.map(|&v| v.into()),
            Map::FullConfidence => self.full.confidence.map(|&v| v.into()),
        }
    }

    pub(crate) fn write(&mut self, map: Map, values: &Plane<i32>) {
        self.write_part(map, values, &Rect::whole(values.size()), (0, 0));
    }

    /// Copies `part` of `values` into `map`, with its top left corner at `corner`.
    pub(crate) fn write_part(&mut self, map: Map, values: &Plane<i32>, part: &Rect, corner: (usize, usize)) {
        fn put<T>(
            plane: &mut Plane<T>,
            (values, part, (x, y)): (&Plane<i32>, &Rect, (usize, usize)),
            set: impl Fn(&mut T, i32),
        ) {
            for (row, y) in part.y.clone().zip(y..) {
                let old = plane.row_mut(y)[x..].iter_mut();
                old.zip(&values.row(row)[part.x.clone()]).for_each(|(old, &new)| set(old, new));
            }
        }
        let from = (values, part, corner);
        match map {
            Map::Label => put(&mut self.optima, from, |p, v| p.label = v as u16),
            Map::Best => put(&mut self.optima, from, |p, v| p.best = v as u16),
            Map::RunnerUp => put(&mut self.optima, from, |p, v| p.runner_up = v as u16),
            Map::RightLabel => put(&mut self.right, from, |old, v| *old = v as u16),
            Map::RightBest => put(&mut self.right_best, from, |old, v| *old = v as u16),
            Map::Raw => put(&mut self.raw, from, |old, v| *old = v),
            Map::Disparity => put(&mut self.disparity, from, |old, v| *old = v),
            Map::Validity => put(&mut self.validity, from, |old, v| *old = v as u8),
            Map::Confidence => put(&mut self.confidence, from, |old, v| *old = v as u8),
            Map::Anchor => put(&mut self.anchors, from, |old, v| *old = v),
            Map::FullRaw => put(&mut self.full.raw, from, |old, v| *old = v),
            Map::FullDisparity => put(&mut self.full.disparity, from, |old, v| *old = v),
            Map::FullValidity => put(&mut self.full.validity, from, |old, v| *old = v as u8),
            Map::FullConfidence => put(&mut self.full.confidence, from, |old, v| *old = v as u8),
        }
    }

    /// Takes the anchors of a prior, if there is one, and returns its levels.
    pub(crate) fn take_prior(&mut self, prior: Option<LevelPriors>) -> Vec<Plane<LabelPrior>> {
        self.anchors.data_mut().fill(NO_ANCHOR);
        let Some(LevelPriors { levels, anchors }) = prior else { return Vec::new() };
        if !self.anchors.data().is_empty() {
            self.anchors = anchors;
        }
        levels
    }

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
