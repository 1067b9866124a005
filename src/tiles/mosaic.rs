//! The maps of an image that is matched tile by tile, and the stages that finish them.

use super::Tile;
use crate::backend::cpu::Finest;
use crate::backend::{Backend, Map, NO_LABEL, Stage};
use crate::error::{Error, Purpose, Result};
use crate::image::{Image, Pair, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::options::Illumination;
use crate::plan::Plan;
use std::mem;
use std::sync::Arc;

/// The maps of a whole image, put together from those of its tiles, without any volume: no stage after
/// [`Stage::SubPixel`] needs one.
pub struct Mosaic {
    plan: Plan,
    /// The reference view, and the other one where its map is wanted, as they were matched.
    left: Arc<Image>,
    right: Option<Arc<Image>>,
    maps: Finest,
    /// Disparity of the right view before post-processing, in 1/256 px; empty where its map is not wanted.
    right_raw: Plane<i32>,
}

impl Mosaic {
    /// Empty maps for a match of `pair` by `plan`, the plan for the whole image.
    ///
    /// # Errors
    /// [`Error::Memory`] when the machine cannot hold them, and [`Error::Mismatch`] when the plan is for another size.
    pub fn new(plan: &Plan, pair: &Pair) -> Result<Self> {
        if plan.size() != pair.size() {
            let (plan, pair) = (plan.size(), pair.size());
            return Err(Error::Mismatch(format!("a plan for {plan:?} and a pair of {pair:?}")));
        }
        memory::check(plan.mosaic_bytes(), Purpose::Match)?;
        let (width, height) = plan.size();
        let maps = Finest {
            right: Plane::filled(width, height, NO_LABEL),
            right_best: Plane::filled(width, height, u16::MAX),
            ..Finest::new((width, height))
        };
        let wanted = plan.method.refinement.right_map;
        let right_raw = if wanted { Plane::filled(width, height, 0) } else { Plane::filled(0, 0, 0) };
        let right = wanted.then(|| pair.shared_right());
        Ok(Self { plan: plan.clone(), left: pair.shared_left(), right, maps, right_raw })
    }

    /// Takes over what `tile` leaves on `backend`, which matched `pair`, its crop: maps of its core, and where it sees the
    /// right view better than the tiles before, that. Returns where in its crop it does.
    ///
    /// # Errors
    /// Those of `backend`.
    pub async fn place(
        &mut self,
        tile: &Tile,
        pair: &Pair,
        backend: &mut dyn Backend,
    ) -> Result<Plane<bool>> {
        let Tile { core, crop, .. } = tile;
        let part = core.within(crop);
        for map in [Map::Label, Map::Best, Map::RunnerUp, Map::Raw] {
            self.maps.write_part(map, &backend.map(map).await?, &part, (core.x.start, core.y.start));
        }
        let (width, height) = crop.size();
        let mut better = Plane::filled(width, height, false);
        if self.plan.reads_right_view() {
            let (labels, best) = (backend.map(Map::RightLabel).await?, backend.map(Map::RightBest).await?);
            for (y, row) in core.y.clone().zip(part.y.clone()) {
                let old_best = self.maps.right_best.row_mut(y)[crop.x.clone()].iter_mut();
                let old = old_best.zip(&mut self.maps.right.row_mut(y)[crop.x.clone()]);
                let new = best.row(row).iter().zip(labels.row(row)).zip(better.row_mut(row));
                for ((old_best, old_label), ((&best, &label), better)) in old.zip(new) {
                    *better = (best, label) < (i32::from(*old_best), i32::from(*old_label));
                    if *better {
                        (*old_best, *old_label) = (best as u16, label as u16);
                    }
                }
            }
        }
        if self.plan.method.front.illumination != Illumination::None {
            // What follows looks at colours as they were matched.
            let views = [Some((&mut self.left, pair.left())), self.right.as_mut().map(|r| (r, pair.right()))];
            for (whole, matched) in views.into_iter().flatten() {
                let whole = &mut Arc::make_mut(whole).pixels;
                for (y, row) in core.y.clone().zip(part.y.clone()) {
                    let from = &matched.pixels.row(row)[part.x.clone()];
                    whole.row_mut(y)[core.x.clone()].copy_from_slice(from);
                }
            }
        }
        Ok(better)
    }

    /// Takes over the disparities of the right view that `tile` leaves on `backend` after the views were swapped, where it sees
    /// that view `better` than the tiles before.
    ///
    /// # Errors
    /// Those of `backend`.
    pub async fn place_right(
        &mut self,
        tile: &Tile,
        better: &Plane<bool>,
        backend: &mut dyn Backend,
    ) -> Result<()> {
        let raw = backend.map(Map::Raw).await?.mirrored();
        for (y, row) in tile.crop.y.clone().zip(0..) {
            let old = self.right_raw.row_mut(y)[tile.crop.x.clone()].iter_mut();
            for ((old, &new), _) in old.zip(raw.row(row)).zip(better.row(row)).filter(|(_, better)| **better)
            {
                *old = new;
            }
        }
        Ok(())
    }

    /// Takes over the labels that `tile` leaves on `backend`, which matched its crop of the mirrored pair, as labels of the
    /// right view, and where its map is wanted the disparities.
    ///
    /// # Errors
    /// Those of `backend`.
    pub async fn place_mirrored(&mut self, tile: &Tile, backend: &mut dyn Backend) -> Result<()> {
        let (width, _) = self.plan.size();
        let (core, crop) = (tile.core.mirrored(width), tile.crop.mirrored(width));
        let labels = backend.map(Map::Label).await?.mirrored();
        let part = core.within(&crop);
        self.maps.write_part(Map::RightLabel, &labels, &part, (core.x.start, core.y.start));
        if self.right.is_some() {
            let raw = backend.map(Map::Raw).await?.mirrored();
            for (y, row) in core.y.clone().zip(part.y) {
                let from = &raw.row(row)[part.x.clone()];
                self.right_raw.row_mut(y)[core.x.clone()].copy_from_slice(from);
            }
        }
        Ok(())
    }

    /// Runs a stage that follows [`Stage::SubPixel`], once all tiles are in place.
    pub fn run(&mut self, stage: Stage) {
        if stage == Stage::LeftRightCheck {
            self.maps.disparity = self.maps.raw.clone();
        }
        self.maps.run(stage, &self.plan, &self.left);
    }

    /// The maps, once all stages have run; they are gone from here.
    pub fn take_maps(&mut self) -> Maps {
        let Finest { raw, disparity, validity, confidence, .. } = &mut self.maps;
        let empty = || Plane::filled(0, 0, 0);
        Maps {
            disparity: mem::replace(disparity, empty()),
            raw: mem::replace(raw, empty()),
            confidence: mem::replace(confidence, Plane::filled(0, 0, 0)),
            validity: mem::replace(validity, Plane::filled(0, 0, 0)),
            right: None,
        }
    }

    /// Puts the right view in the place of the left one, both mirrored, once the maps of the left one are taken.
    pub fn swap_views(&mut self) {
        let (width, height) = self.plan.size();
        if let Some(right) = self.right.take() {
            self.left = Arc::new(right.mirrored());
        }
        self.maps.swap_views();
        self.maps.raw = mem::replace(&mut self.right_raw, Plane::filled(0, 0, 0)).mirrored();
        (self.maps.validity, self.maps.confidence) =
            (Plane::filled(width, height, 0), Plane::filled(width, height, 0));
    }
}
