//! Priors in C's memory: disparities of the left image that are known before the match.

use std::cell::Cell;

use mrfgs::prior;

use crate::argument;
use crate::maps;
use crate::status::{Failure, Status, call};

/// How a prior is used.
#[repr(u32)]
#[derive(Clone, Copy)]
pub enum PriorKind {
    /// Points, and maps of which at most a fifth is known, are MRFGS_PRIOR_KIND_POINTS, other maps MRFGS_PRIOR_KIND_SURFACE.
    Auto = 0,
    /// Exact but sparse, as of a lidar: they are cleaned and spread, and decide where no match can be trusted.
    Points = 1,
    /// Dense but coarse, as a terrain model: it only shifts the balance between disparities.
    Surface = 2,
}

/// A point of the left image with known disparity. All fields are in pixels.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PriorPoint {
    /// The column; whole numbers are centres of pixels.
    pub x: f64,
    /// The row.
    pub y: f64,
    pub disparity: f64,
    /// The standard deviation of the disparity; 0 means that of the prior.
    pub sigma: f64,
}

/// What is known of the left image: either points or a map. Set what is not used to 0. Strides are in bytes, from one row to the next.
#[repr(C)]
pub struct Prior {
    /// sizeof(mrfgs_prior).
    pub size: usize,
    /// The points, or null for a map. Points outside the image are left out.
    pub points: *const PriorPoint,
    /// Number of points.
    pub count: usize,
    /// Disparities in pixels, a map of the size of the left image, or null for points. NaN or infinity where nothing is known.
    pub disparity: *const f32,
    pub disparity_stride: usize,
    /// Standard deviations of the disparities in pixels, a map of the same size, where 0 means `usual_sigma`. Null means that everywhere.
    pub sigma: *const f32,
    pub sigma_stride: usize,
    /// Standard deviation in pixels where no other is given; 0 means 0.25 for points and 1 for a surface.
    pub usual_sigma: f64,
    /// An mrfgs_prior_kind.
    pub kind: u32,
}

impl Prior {
    /// Copies the caller's prior of a left image of this size; `None` if it is null.
    ///
    /// # Safety
    /// `prior` is null, or starts with its size and, if that is the size of `Self`, has that many bytes. Its points and maps are as large
    /// as its fields say.
    pub(crate) unsafe fn given(
        prior: *const Self,
        size: (usize, usize),
    ) -> Result<Option<prior::Prior>, Failure> {
        if prior.is_null() {
            return Ok(None);
        }
        // SAFETY: the caller guarantees the size, which is the first field.
        let own = unsafe { prior.cast::<usize>().read() };
        if own != size_of::<Self>() {
            return Err(argument::wrong_size::<Self>(&format!("prior.size is {own}"), "mrfgs_prior"));
        }
        // SAFETY: it is not null, and the caller guarantees its size.
        let prior = unsafe { &*prior };
        let kind = prior.kind()?;
        let sigma = prior.usual_sigma;
        if !(sigma >= 0.0 && sigma.is_finite()) {
            return Err(Failure::argument(format!(
                "prior.usual_sigma is {sigma}: give pixels above 0, or 0 for the usual ones"
            )));
        }
        let refused = |why: &str| Err(Failure::argument(why));
        match (prior.points.is_null(), prior.disparity.is_null()) {
            (true, _) if prior.count > 0 => refused("prior.points is null, but prior.count is above 0"),
            (true, true) => refused("the prior is empty: give prior.points or prior.disparity"),
            (false, false) => refused("the prior has points and a map: give one of them"),
            (false, true) if kind == Some(prior::PriorKind::Surface) => {
                refused("prior.kind is a surface, but the prior has points: give a map")
            }
            (false, true) if !prior.sigma.is_null() => {
                refused("the prior has points and a map of sigma: give the sigma of each point")
            }
            // SAFETY: guaranteed by the caller.
            (false, true) => unsafe { prior.of_points(size) }.map(Some),
            // SAFETY: guaranteed by the caller.
            (true, false) => unsafe { prior.of_map(kind, size) }.map(Some),
        }
    }

    /// The kind, unless it is to be found.
    fn kind(&self) -> Result<Option<prior::PriorKind>, Failure> {
        const AUTO: u32 = PriorKind::Auto as u32;
        const POINTS: u32 = PriorKind::Points as u32;
        const SURFACE: u32 = PriorKind::Surface as u32;
        match self.kind {
            AUTO => Ok(None),
            POINTS => Ok(Some(prior::PriorKind::Points)),
            SURFACE => Ok(Some(prior::PriorKind::Surface)),
            kind => Err(Failure::argument(format!("prior.kind is {kind}; give an mrfgs_prior_kind, 0 to 2"))),
        }
    }

    /// The standard deviation of a prior of this kind where no other is given.
    fn usual(&self, kind: prior::PriorKind) -> f64 {
        if self.usual_sigma > 0.0 { self.usual_sigma } else { kind.usual_sigma() }
    }

    /// # Safety
    /// There are as many points as `count` says.
    unsafe fn of_points(&self, size: (usize, usize)) -> Result<prior::Prior, Failure> {
        let usual = self.usual(prior::PriorKind::Points);
        let points = (0..self.count).map(|i| {
            // SAFETY: the caller guarantees that the array has this many elements.
            let point = unsafe { self.points.add(i) };
            // SAFETY: as above.
            let PriorPoint { x, y, disparity, sigma } = unsafe { point.read() };
            prior::PriorPoint { x, y, disparity, sigma: if sigma == 0.0 { usual } else { sigma } }
        });
        Ok(prior::Prior::points(size, points)?)
    }

    /// # Safety
    /// The maps are as large as this size and their strides say.
    unsafe fn of_map(
        &self,
        kind: Option<prior::PriorKind>,
        size: (usize, usize),
    ) -> Result<prior::Prior, Failure> {
        maps::check("prior.disparity", self.disparity, self.disparity_stride, size)?;
        // SAFETY: it was checked, and the caller guarantees its size.
        let disparity = unsafe { maps::read(self.disparity, self.disparity_stride, size) };
        let kind = kind.unwrap_or_else(|| prior::PriorKind::of_map(&disparity));
        let usual = self.usual(kind);
        if self.sigma.is_null() {
            return Ok(prior::Prior::map(kind, &disparity, usual)?);
        }
        maps::check("prior.sigma", self.sigma, self.sigma_stride, size)?;
        // SAFETY: as above.
        let sigma = unsafe { maps::read(self.sigma, self.sigma_stride, size) };
        let sigma = sigma.map(|&sigma| if sigma == 0.0 { usual as f32 } else { sigma });
        Ok(prior::Prior::map_with(kind, &disparity, &sigma)?)
    }
}

/// How much of a prior was used. All fields are 0 for a match without a prior.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PriorUse {
    /// Number of pixels for which a disparity was given, at the size of the match: some options halve it.
    pub given: usize,
    /// Number of these that their neighbours contradict; they were dropped.
    pub dropped: usize,
    /// How well the images agree with it, 0 to 1. Where they contradict it, it counts less; at 0 it was not used at all.
    pub trust: f64,
    /// How it was used: MRFGS_PRIOR_KIND_POINTS or MRFGS_PRIOR_KIND_SURFACE.
    pub kind: u32,
}

impl PriorUse {
    const NOTHING: Self = Self { given: 0, dropped: 0, trust: 0.0, kind: PriorKind::Auto as u32 };
}

thread_local! {
    static LAST: Cell<PriorUse> = const { Cell::new(PriorUse::NOTHING) };
}

/// How much of its prior this thread's last successful match used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mrfgs_last_prior(used: *mut PriorUse) -> Status {
    call(|| {
        if used.is_null() {
            return Err(Failure::argument("the place for the use of the prior is null"));
        }
        // SAFETY: it is not null, and the caller guarantees that it is writable.
        unsafe { used.write(LAST.get()) };
        Ok(())
    })
}

/// Keeps what a match has used for `mrfgs_last_prior`.
pub(crate) fn say(used: Option<prior::PriorUse>) {
    LAST.set(used.map_or(PriorUse::NOTHING, |used| PriorUse {
        given: used.given,
        dropped: used.dropped,
        trust: used.trust,
        kind: match used.kind {
            prior::PriorKind::Points => PriorKind::Points,
            prior::PriorKind::Surface => PriorKind::Surface,
        } as u32,
    }));
}
