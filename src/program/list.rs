//! The list of steps that a match is.

use crate::image::Rect;
use crate::plan::Plan;
use crate::stage::{Data, Stage};
use std::ops::Range;

/// A part of the pair, as it goes to a backend.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The plan for it, as it is followed.
    pub plan: Plan,
    /// The pixels of the left view that are matched.
    pub crop: Rect,
    /// Those of them that enter the maps.
    pub core: Rect,
    /// Whether both views are mirrored and exchanged: the right view becomes the left one, its matches to the left again.
    pub mirrored: bool,
    /// Its place among the tiles of the image, from 1 on, and their number, twice that where they are matched twice; `None` where
    /// the image is in one piece.
    pub tile: Option<(usize, usize)>,
}

impl Frame {
    /// The whole image in one piece.
    #[must_use]
    pub fn whole(plan: &Plan) -> Self {
        let all = Rect::whole(plan.size());
        Self { plan: plan.clone(), crop: all.clone(), core: all, mirrored: false, tile: None }
    }
}

/// A view of the pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum View {
    /// The reference view.
    Left,
    /// The other one, from the beliefs of the reference view.
    Right,
    /// The other one, as the left view of the mirrored pair.
    Mirrored,
}

/// What some rows of a stage are run with.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Part {
    /// Rows of the stage's level.
    pub rows: Range<usize>,
    /// The messages that there are when its first rows run.
    pub sent: Sent,
}

/// Which messages there are when a stage starts. Those that have not been sent count as 0, whatever is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sent {
    /// Those of the level's dependency factors.
    pub dependency: bool,
    /// Those between the level and the next coarser one.
    pub above: bool,
    /// Those between the level and the next finer one.
    pub below: bool,
}

/// One run of a stage.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Run {
    /// The stage, at the finest level that it runs at.
    pub stage: Stage,
    /// At how many levels it runs, one next to the other.
    pub levels: usize,
    /// Some rows of its level; `None` for all.
    pub part: Option<Part>,
}

impl From<Stage> for Run {
    fn from(stage: Stage) -> Self {
        Self { stage, levels: 1, part: None }
    }
}

impl Run {
    /// The stage at each of its levels.
    pub fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        let stage = self.stage;
        (0..self.levels).map(move |coarser| stage.coarser(coarser))
    }

    /// About how long it takes on one thread, in ns.
    #[must_use]
    pub fn work(&self, plan: &Plan) -> f64 {
        let all: f64 = self.stages().map(|stage| stage.work(plan)).sum();
        let height = plan.levels[self.stage.level().unwrap_or(0)].height;
        all * self.part.as_ref().map_or(1.0, |part| part.rows.len() as f64 / height as f64)
    }
}

/// A step of a match.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Corrects the pair.
    Condition,
    /// The pair at twice its size takes the place of the pair.
    Double,
    /// Takes this frame to the backend: the stages that follow work on it.
    Enter(usize),
    /// Runs a stage.
    Run(Run),
    /// Nobody needs this any more.
    Free(Data),
    /// An iteration is done.
    Iteration,
    /// Where message passing has settled, the steps up to [`Step::EndOfPhase`] are left out.
    Settled,
    /// The end of a phase that may settle.
    EndOfPhase,
    /// Starts the maps of the whole image, of which this is the frame: they are put together from those of tiles.
    Mosaic(usize),
    /// Takes what the frame has found of a view into the maps of the whole image.
    Place(View),
    /// All tiles are in place: the stages that follow work on the maps of the whole image.
    Gather,
    /// There, takes the disparities of the right view in the place of those of the left one.
    PlaceRight,
    /// Asks for the maps of a view.
    Ask(View),
    /// Waits for the maps that were asked for.
    Collect,
    /// Makes one map of those at both sizes.
    Join,
}

impl Step {
    /// A run of `stage`.
    #[must_use]
    pub fn of(stage: Stage) -> Self {
        Self::Run(stage.into())
    }

    /// The stage that it runs, if it does.
    #[must_use]
    pub fn stage(&self) -> Option<Stage> {
        match self {
            Self::Run(run) => Some(run.stage),
            _ => None,
        }
    }
}

/// The steps of a match, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// What the steps enter.
    pub frames: Vec<Frame>,
    /// The steps.
    pub steps: Vec<Step>,
}

impl Program {
    /// Whether the only wait is for the maps, at the end: until then, nothing is asked of the backend that it has not done yet.
    #[must_use]
    pub fn waits_once(&self) -> bool {
        let waits = |step: &Step| matches!(step, Step::Collect | Step::Place(_));
        self.steps.iter().position(waits) == Some(self.steps.len() - 1)
    }

    /// Each step with the plan of its frame: that of the first one before any is entered.
    pub fn with_plans(&self) -> impl Iterator<Item = (&Step, &Plan)> {
        let mut frame = 0;
        self.steps.iter().map(move |step| {
            if let Step::Enter(entered) | Step::Mosaic(entered) = step {
                frame = *entered;
            }
            (step, &self.frames[frame].plan)
        })
    }

    /// About how long it takes on one thread, in ns.
    #[must_use]
    pub fn work(&self) -> f64 {
        let runs = self.with_plans().map(|(step, plan)| match step {
            Step::Run(run) => run.work(plan),
            _ => 0.0,
        });
        runs.sum()
    }

    /// The same match, with the steps of each frame that is entered made anew by `pass`, which may change the plan.
    #[must_use]
    pub fn each_frame(self, mut pass: impl FnMut(&mut Plan, Vec<Step>) -> Vec<Step>) -> Self {
        let Self { mut frames, steps } = self;
        let mut rest = steps.into_iter().peekable();
        let mut all = Vec::new();
        while let Some(step) = rest.next() {
            let entered = if let Step::Enter(frame) = step { Some(frame) } else { None };
            all.push(step);
            if let Some(frame) = entered {
                let ends = |step: &Step| matches!(step, Step::Enter(_) | Step::Gather | Step::Double);
                let of_frame: Vec<Step> = std::iter::from_fn(|| rest.next_if(|step| !ends(step))).collect();
                all.extend(pass(&mut frames[frame].plan, of_frame));
            }
        }
        Self { frames, steps: all }
    }
}
