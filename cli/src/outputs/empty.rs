//! Why depths and points come out empty, and what helps.

use mrfgs::depth::Rig;
use mrfgs::image::Plane;
use mrfgs::maps::FRACTION;

use crate::args::Sign;
use crate::outputs::limits::Limits;
use crate::outputs::outcome::Outcome;

/// How many disparities of a map are of something in front of the cameras.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InFront {
    pub(crate) all: usize,
    pub(crate) seen: usize,
    /// How many were if they counted the other way.
    negated: usize,
}

impl InFront {
    pub(crate) fn of(map: &Plane<f32>, rig: &Rig) -> Self {
        let known = || map.data().iter().copied().filter(|d| d.is_finite());
        let seen = |sign: f64| known().filter(|d| rig.depth(sign * f64::from(*d)).is_some()).count();
        Self { all: known().count(), seen: seen(1.0), negated: seen(-1.0) }
    }

    /// A warning if most disparities lie behind the cameras, with the remedy `turned` if the opposite sign helps, and `check` if not.
    pub(crate) fn doubt(self, turned: &str, check: &str) -> Option<String> {
        let Self { all, seen, negated } = self;
        let remedy = if negated > seen { turned } else { check };
        let behind = all - seen;
        (2 * seen < all).then(|| format!("{behind} of {all} disparities lie behind the cameras; {remedy}"))
    }
}

/// The sign that the user has not chosen, as advice for disparities that are behind the cameras.
pub(crate) fn other_sign(sign: Sign) -> String {
    let other = match sign {
        Sign::LeftMinusRight => "right-minus-left",
        Sign::RightMinusLeft => "left-minus-right",
    };
    format!("they may have the opposite sign: try --sign {other}")
}

/// Why no disparity in front of the cameras has a depth, or gives one of the `points` that are wanted, and what helps.
pub(super) fn left_out(limits: Limits, outcome: &Outcome, points: bool) -> Option<String> {
    let rig = outcome.rig.as_ref()?;
    let has_depths = |map: &Plane<f32>| InFront::of(map, rig).seen > 0;
    if !has_depths(&outcome.maps.final_map()) {
        return None;
    }
    let sure = outcome.final_map(limits);
    if !has_depths(&sure) {
        return Some("--min-confidence leaves no depths and no points: lower it".into());
    }
    let depths = rig.depths(&sure);
    if !has_depths(&limits.near(sure, rig)) {
        let nearest = depths.data().iter().copied().fold(f32::INFINITY, f32::min);
        return Some(format!(
            "--clip-depth leaves nothing, since the nearest depth is {nearest:.3}: raise it"
        ));
    }
    let trusted = limits.trusted(outcome.maps, rig);
    let is_seen = |d: i32| rig.depth(f64::from(d) / f64::from(FRACTION)).is_some();
    let mut pixels = trusted.disparity.data().iter().zip(trusted.validity.data());
    (points && !pixels.any(|(d, flags)| *flags == 0 && is_seen(*d))).then(|| {
        "points leave out filled pixels and those of low confidence, and there are no others: check that both images show the same scene, and check the range"
            .into()
    })
}
