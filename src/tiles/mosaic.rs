//! The maps of an image that is matched tile by tile, and the stages that finish them.

use super::Tile;
use crate::backend::cpu::Finest;
use crate::backend::{Backend, Map, NO_LABEL, Stage};
use crate::error::{Error, Purpose, Result};
use crate::image::{Image, Pair, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::options::{Illumination, LeftRightCheck};
use crate::plan::Plan;
use std::sync::Arc;

/// The maps of a whole image, put together from those of its tiles, without any volume: no stage after
/// [`Stage::SubPixel`] needs one.
pub struct Mosaic {
    plan: Plan,
    left: Arc<Image>,
    maps: Finest,
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
        Ok(Self { plan: plan.clone(), left: pair.shared_left(), maps })
    }

    /// Takes over what `tile` leaves on `backend`, which matched `pair`, its crop: maps of its core, and where it sees the
    /// right view better than the tiles before, that.
    ///
    /// # Errors
    /// Those of `backend`.
    pub fn place(&mut self, tile: &Tile, pair: &Pair, backend: &mut dyn Backend) -> Result<()> {
        let Tile { core, crop, .. } = tile;
        let part = core.within(crop);
        for map in [Map::Label, Map::Best, Map::RunnerUp, Map::Raw] {
            self.maps.write_part(map, &backend.map(map)?, &part, (core.x.start, core.y.start));
        }
        if self.plan.method.refinement.left_right_check == LeftRightCheck::RightView {
            let (labels, best) = (backend.map(Map::RightLabel)?, backend.map(Map::RightBest)?);
            for (y, row) in core.y.clone().zip(part.y.clone()) {
                let old_best = self.maps.right_best.row_mut(y)[crop.x.clone()].iter_mut();
                let old = old_best.zip(&mut self.maps.right.row_mut(y)[crop.x.clone()]);
                let new = best.row(row).iter().zip(labels.row(row));
                for ((old_best, old_label), (&best, &label)) in old.zip(new) {
                    if (best, label) < (i32::from(*old_best), i32::from(*old_label)) {
                        (*old_best, *old_label) = (best as u16, label as u16);
                    }
                }
            }
        }
        if self.plan.method.front.illumination != Illumination::None {
            // What follows looks at colours as they were matched.
            let left = &mut Arc::make_mut(&mut self.left).pixels;
            for (y, row) in core.y.clone().zip(part.y) {
                left.row_mut(y)[core.x.clone()].copy_from_slice(&pair.left().pixels.row(row)[part.x.clone()]);
            }
        }
        Ok(())
    }

    /// Takes over the labels that `tile` leaves on `backend`, which matched its crop of the mirrored pair, as labels of the
    /// right view.
    ///
    /// # Errors
    /// Those of `backend`.
    pub fn place_mirrored(&mut self, tile: &Tile, backend: &mut dyn Backend) -> Result<()> {
        let (width, _) = self.plan.size();
        let (core, crop) = (tile.core.mirrored(width), tile.crop.mirrored(width));
        let labels = backend.map(Map::Label)?.mirrored();
        self.maps.write_part(Map::RightLabel, &labels, &core.within(&crop), (core.x.start, core.y.start));
        Ok(())
    }

    /// Runs a stage that follows [`Stage::SubPixel`], once all tiles are in place.
    pub fn run(&mut self, stage: Stage) {
        if stage == Stage::LeftRightCheck {
            self.maps.disparity = self.maps.raw.clone();
            self.maps.right_best = Plane::filled(0, 0, 0);
        }
        self.maps.run(stage, &self.plan, &self.left);
    }

    /// The maps, once all stages have run.
    #[must_use]
    pub fn into_maps(self) -> Maps {
        let Finest { raw, disparity, validity, confidence, .. } = self.maps;
        Maps { disparity, raw, confidence, validity }
    }
}
