//! The result of a match, for its outputs.

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

/// The view that a map belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum View {
    Left,
    Right,
}

/// The quantity that an error belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Disparities,
    Depths,
}

/// The result of a match, for its outputs.
pub(crate) struct Outcome<'a> {
    pub(crate) maps: &'a Maps,
    pub(crate) range: DisparityRange,
    pub(crate) sign: Sign,
    /// The left image, if an output shows it.
    pub(crate) left: Option<&'a Image>,
    /// The cameras, if an output needs them.
    pub(crate) rig: Option<Rig>,
    /// The rotation from the left camera's frame to the rectified frame, if the images were rectified.
    pub(crate) rectifying: Option<Matrix>,
    /// The camera of `--into`.
    pub(crate) third: Option<ThirdCamera>,
    /// Computes errors from confidences, if the maps come from a match.
    pub(crate) sigma: Option<Sigma>,
    /// The georeferences of both views.
    pub(crate) georeferences: [Option<Georeference>; 2],
}

impl Outcome<'_> {
    /// The disparity map without uncertain pixels.
    pub(crate) fn final_map(&self, limits: Limits) -> Plane<f32> {
        limits.sure(self.maps.final_map(), self.maps)
    }

    /// Expected errors of the remaining pixels; `None` if unknown, or for depths without cameras.
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

    /// The median error of all measured disparities; `None` without any, or if errors are unknown.
    pub(crate) fn typical_sigma(&self) -> Option<f32> {
        let mut sigmas = self.sigma?.map(self.maps).into_data();
        sigmas.retain(|sigma| sigma.is_finite());
        let middle = sigmas.len().checked_sub(1)? / 2;
        Some(*sigmas.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// Writes maps with the georeference of `view`.
    pub(crate) fn writer(&self, view: View) -> Writer {
        Writer { georeference: self.georeferences[view as usize].clone() }
    }
}
