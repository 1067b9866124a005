//! What a match has found, as outputs need it.

use mrfgs::calibration::cameras::ThirdCamera;
use mrfgs::calibration::matrix::Matrix;
use mrfgs::depth::Rig;
use mrfgs::image::write::Writer;
use mrfgs::image::{Georeference, Image, Plane};
use mrfgs::maps::Maps;
use mrfgs::options::DisparityRange;
use mrfgs::sigma::Sigma;

use crate::args::Sign;
use crate::outputs::limits::Limits;

/// The view whose pixels a map has.
#[derive(Clone, Copy, Debug)]
pub(crate) enum View {
    Left,
    Right,
}

/// What an error is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Disparities,
    Depths,
}

/// What a match has found, for its outputs.
pub(crate) struct Outcome<'a> {
    pub(crate) maps: &'a Maps,
    pub(crate) range: DisparityRange,
    pub(crate) sign: Sign,
    /// The left image, where an output shows it.
    pub(crate) left: Option<&'a Image>,
    /// The cameras, where an output takes them.
    pub(crate) rig: Option<Rig>,
    /// The rotation from the frame of the left camera to the rectified one, where the images were rectified.
    pub(crate) rectifying: Option<Matrix>,
    /// The camera that an output is in the view of.
    pub(crate) third: Option<ThirdCamera>,
    /// How the errors follow from the confidence, where a match found the maps.
    pub(crate) sigma: Option<Sigma>,
    /// The georeferences of the views.
    pub(crate) georeferences: [Option<Georeference>; 2],
}

impl Outcome<'_> {
    /// The disparity map, without what is not sure.
    pub(crate) fn final_map(&self, limits: Limits) -> Plane<f32> {
        limits.sure(self.maps.final_map(), self.maps)
    }

    /// The errors of what is sure: `None` where they are not known, or those of depths are wanted without cameras.
    pub(super) fn sigmas(&self, of: Of, limits: Limits) -> Option<Plane<f32>> {
        let (mut map, sigmas) = (self.final_map(limits), self.sigma?.map(self.maps));
        if let Some(rig) = &self.rig {
            map = limits.near(map, rig);
        }
        match of {
            Of::Depths => Some(self.rig?.depth_sigmas(&map, &sigmas)),
            Of::Disparities => {
                let (width, height) = map.size();
                let sigma = |x, y| if map[(x, y)].is_finite() { sigmas[(x, y)] } else { f32::INFINITY };
                Some(Plane::from_fn(width, height, sigma))
            }
        }
    }

    /// The median of the errors of all measured disparities; `None` where none is, or errors are not known.
    pub(crate) fn typical_sigma(&self) -> Option<f32> {
        let mut sigmas = self.sigma?.map(self.maps).into_data();
        sigmas.retain(|sigma| sigma.is_finite());
        let middle = sigmas.len().checked_sub(1)? / 2;
        Some(*sigmas.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// What writes a map with the pixels of `view`.
    pub(crate) fn writer(&self, view: View) -> Writer {
        Writer { georeference: self.georeferences[view as usize].clone() }
    }
}
