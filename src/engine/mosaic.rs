//! The maps of an image that is matched in tiles.

use crate::backend::cpu::Cpu;
use crate::backend::{Backend, Map, NO_LABEL};
use crate::error::{Error, Purpose, Result};
use crate::image::{Pair, Plane, Rect};
use crate::memory;
use crate::plan::Plan;
use crate::program::{Frame, View};
use crate::stage::MapSet;

/// The maps of a whole image, assembled from those of its tiles. It has no volumes: the remaining stages need none.
pub(super) struct Mosaic {
    plan: Plan,
    /// The pair as it is matched.
    pair: Pair,
    maps: MapSet,
    /// Disparity of the right view before post-processing, in 1/256 px; empty if its map is not wanted.
    right_raw: Plane<i32>,
    /// Pixels of the right view that the last tile matches better than those before.
    better: Plane<bool>,
}

impl Mosaic {
    /// Empty maps for a match of `pair` by `plan`, the plan for the whole image, with the anchors of a prior.
    ///
    /// # Errors
    /// [`Error::Memory`] when the machine cannot hold them, and [`Error::Mismatch`] when the plan is for another size.
    pub(super) fn new(plan: &Plan, pair: &Pair, anchors: Option<Plane<i32>>) -> Result<Self> {
        if plan.size() != pair.size() {
            let (plan, pair) = (plan.size(), pair.size());
            return Err(Error::Mismatch(format!("a plan for {plan:?} and a pair of {pair:?}")));
        }
        memory::check(plan.mosaic_bytes(), Purpose::Match)?;
        let (width, height) = plan.size();
        let empty = MapSet::new(plan);
        let maps = MapSet {
            anchors: anchors.unwrap_or_else(|| empty.anchors.clone()),
            right: Plane::filled(width, height, NO_LABEL),
            right_best: Plane::filled(width, height, u16::MAX),
            ..empty
        };
        let wanted = plan.method.refinement.right_map;
        let right_raw = if wanted { Plane::filled(width, height, 0) } else { Plane::filled(0, 0, 0) };
        let better = Plane::filled(0, 0, false);
        Ok(Self { plan: plan.clone(), pair: pair.clone(), maps, right_raw, better })
    }

    /// The maps of an earlier look, which the tiles of the next one fill again.
    pub(super) fn again(plan: &Plan, pair: Pair, mut maps: MapSet, right_raw: Plane<i32>) -> Self {
        if plan.reads_right_view() {
            maps.right.data_mut().fill(NO_LABEL);
            maps.right_best.data_mut().fill(u16::MAX);
        }
        Self { plan: plan.clone(), pair, maps, right_raw, better: Plane::filled(0, 0, false) }
    }

    /// Copies the maps of `view` in the core of `frame` from `backend`, which matched `pair`, the tile's part of the whole pair.
    ///
    /// # Errors
    /// The errors of `backend`.
    pub(super) async fn place(
        &mut self,
        frame: &Frame,
        view: View,
        pair: &Pair,
        backend: &mut dyn Backend,
    ) -> Result<()> {
        match view {
            View::Left => self.place_left(frame, pair, backend).await,
            View::Right => self.place_right(frame, backend).await,
            View::Mirrored => self.place_mirrored(frame, backend).await,
        }
    }

    /// Copies the maps of the core, and the labels of right pixels that this tile matches best so far.
    async fn place_left(&mut self, frame: &Frame, pair: &Pair, backend: &mut dyn Backend) -> Result<()> {
        let Frame { core, crop, .. } = frame;
        let part = core.within(crop);
        for map in [Map::Label, Map::Best, Map::RunnerUp, Map::Raw] {
            self.maps.write_part(map, &backend.map(map).await?, &part, (core.x.start, core.y.start));
        }
        let (width, height) = crop.size();
        self.better = Plane::filled(width, height, false);
        if self.plan.reads_right_view() {
            let (labels, best) = (backend.map(Map::RightLabel).await?, backend.map(Map::RightBest).await?);
            for (y, row) in core.y.clone().zip(part.y.clone()) {
                let old_best = self.maps.right_best.row_mut(y)[crop.x.clone()].iter_mut();
                let old = old_best.zip(&mut self.maps.right.row_mut(y)[crop.x.clone()]);
                let new = best.row(row).iter().zip(labels.row(row)).zip(self.better.row_mut(row));
                for ((old_best, old_label), ((&best, &label), better)) in old.zip(new) {
                    *better = (best, label) < (i32::from(*old_best), i32::from(*old_label));
                    if *better {
                        (*old_best, *old_label) = (best as u16, label as u16);
                    }
                }
            }
        }
        if self.plan.method.front.corrects_illumination() {
            // Later stages use the colours as they were matched.
            let wanted = 1 + usize::from(self.plan.method.refinement.right_map);
            let views = self.pair.views_mut().into_iter().zip([pair.left(), pair.right()]);
            for (whole, matched) in views.take(wanted) {
                copy_part(&mut whole.pixels, &matched.pixels, core, &part);
            }
        }
        Ok(())
    }

    /// Copies the disparities of the right view that `backend` holds after the views were swapped, for pixels
    /// that this tile matches better.
    async fn place_right(&mut self, frame: &Frame, backend: &mut dyn Backend) -> Result<()> {
        let raw = backend.map(Map::Raw).await?.mirrored();
        for (y, row) in frame.crop.y.clone().zip(0..) {
            let old = self.right_raw.row_mut(y)[frame.crop.x.clone()].iter_mut();
            let new = raw.row(row).iter().zip(self.better.row(row));
            old.zip(new).filter(|(_, (_, better))| **better).for_each(|(old, (&new, _))| *old = new);
        }
        Ok(())
    }

    /// Copies the right view's labels from a tile of the mirrored pair, and its disparities if wanted.
    async fn place_mirrored(&mut self, frame: &Frame, backend: &mut dyn Backend) -> Result<()> {
        let Frame { core, crop, .. } = frame;
        let part = core.within(crop);
        let labels = backend.map(Map::Label).await?.mirrored();
        self.maps.write_part(Map::RightLabel, &labels, &part, (core.x.start, core.y.start));
        if self.plan.method.refinement.right_map {
            copy_part(&mut self.right_raw, &backend.map(Map::Raw).await?.mirrored(), core, &part);
        }
        Ok(())
    }

    /// A backend with the maps, once all tiles are placed, and the disparities of the right view in its own
    /// orientation, if wanted.
    pub(super) fn gathered(self) -> (Cpu, Plane<i32>) {
        let Self { plan, pair, mut maps, right_raw, .. } = self;
        maps.disparity = maps.raw.clone();
        (Cpu::of_maps(&plan, pair, maps), right_raw)
    }
}

/// Copies the values of `core`; `part` is the same area in `from`.
fn copy_part<T: Copy>(to: &mut Plane<T>, from: &Plane<T>, core: &Rect, part: &Rect) {
    for (y, row) in core.y.clone().zip(part.y.clone()) {
        to.row_mut(y)[core.x.clone()].copy_from_slice(&from.row(row)[part.x.clone()]);
    }
}
