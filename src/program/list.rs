//! The list of steps of a match.

use crate::front::conditioning::Conditioning;
use crate::image::Rect;
use crate::plan::Plan;
use crate::prior::Prior;
use crate::stage::{Data, Stage, Volume};
use std::ops::Range;
use std::sync::Arc;

/// A part of the pair that a backend matches at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The plan of this part.
    pub plan: Plan,
    /// The pixels of the left view that are matched.
    pub crop: Rect,
    /// The pixels of the crop that enter the maps.
    pub core: Rect,
    /// Whether views are mirrored and exchanged: the right view becomes the left one, with its matches to the left again.
    pub mirrored: bool,
    /// (number of the tile from 1 on, number of tiles), with twice the number if tiles are matched twice;
    /// `None` if the image is in one piece.
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
    /// The right view, from the beliefs of the left one.
    Right,
    /// The right view, as the left view of the mirrored pair.
    Mirrored,
}

/// A band of rows of a run.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct RowBand {
    /// Rows of the stage's level.
    pub rows: Range<usize>,
    /// The messages that exist when the first rows run.
    pub sent: Sent,
}

/// The messages that exist when a stage starts. Those that have not been sent count as 0, whatever is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sent {
    /// Messages of the level's dependency factors.
    pub dependency: bool,
    /// Messages between the level and the next coarser one.
    pub above: bool,
    /// Messages between the level and the next finer one.
    pub below: bool,
}

impl Sent {
    /// All messages that level `z` of `levels` can have.
    #[must_use]
    pub fn all(z: usize, levels: usize) -> Self {
        Self { dependency: true, above: z + 1 < levels, below: z > 0 }
    }
}

/// The messages of all levels that have been sent, followed from stage to stage.
#[derive(Clone, Debug)]
pub struct SentMessages {
    /// Of the dependency factors of each level.
    dependency: Vec<bool>,
    /// Between each level and the next finer one.
    resolution: Vec<bool>,
}

impl SentMessages {
    /// No messages of `levels` levels.
    #[must_use]
    pub fn none(levels: usize) -> Self {
        Self { dependency: vec![false; levels], resolution: vec![false; levels] }
    }

    /// The messages that exist at the level of `stage`.
    #[must_use]
    pub fn at(&self, stage: Stage) -> Sent {
        let z = stage.level().unwrap_or(0);
        let above = self.resolution.get(z + 1).is_some_and(|sent| *sent);
        Sent { dependency: self.dependency[z], above, below: self.resolution[z] }
    }

    /// Adds the messages that `stage` sends. A level whose labels are set anew loses its own.
    pub fn send(&mut self, stage: Stage) {
        if let Stage::LabelWindow(z) = stage {
            (self.dependency[z], self.resolution[z]) = (false, false);
        }
        stage.writes().filter_map(Data::volume).for_each(|volume| self.add(volume));
    }

    /// Adds the messages of `volume`; those between two levels are sent together.
    fn add(&mut self, volume: Volume) {
        match volume {
            Volume::Dependency(z) => self.dependency[z] = true,
            Volume::Up(z) => self.resolution[z] = true,
            Volume::Down(z) => self.resolution[z + 1] = true,
            _ => {}
        }
    }

    /// Adds the messages of `volume`, for a caller that writes it. Returns the volumes that have to be 0 before, because resolution
    /// factors send both at once and had sent none.
    pub fn write(&mut self, volume: Volume) -> Vec<Volume> {
        let unsent = match volume {
            Volume::Up(z) if self.lacks(volume) => vec![volume, Volume::Down(z - 1)],
            Volume::Down(z) if self.lacks(volume) => vec![volume, Volume::Up(z + 1)],
            _ => Vec::new(),
        };
        self.add(volume);
        unsent
    }

    /// Whether `volume` holds messages that have not been sent.
    #[must_use]
    pub fn lacks(&self, volume: Volume) -> bool {
        match volume {
            Volume::Dependency(z) => !self.dependency[z],
            Volume::Up(z) => !self.resolution[z],
            Volume::Down(z) => !self.resolution[z + 1],
            _ => false,
        }
    }
}

/// One run of a stage.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Run {
    /// The stage, at its finest level.
    pub stage: Stage,
    /// Number of levels that it runs at, from that level on.
    pub levels: usize,
    /// A band of rows of its level; `None` for all rows.
    pub band: Option<RowBand>,
}

impl From<Stage> for Run {
    fn from(stage: Stage) -> Self {
        Self { stage, levels: 1, band: None }
    }
}

impl Run {
    /// The stage at each level.
    pub fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        let stage = self.stage;
        (0..self.levels).map(move |coarser| stage.coarser(coarser))
    }

    /// Approximate time on one thread, in ns.
    #[must_use]
    pub fn work(&self, plan: &Plan) -> f64 {
        let all: f64 = self.stages().map(|stage| stage.work(plan)).sum();
        let height = plan.levels[self.stage.level().unwrap_or(0)].height;
        all * self.band.as_ref().map_or(1.0, |band| band.rows.len() as f64 / height as f64)
    }
}

/// A step of a match.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Conditions the pair.
    Condition,
    /// Makes these corrections to the pair, instead of measuring them.
    Correct(Conditioning),
    /// Prepares this prior of the scene, of the size of the pair.
    Know(Arc<Prior>),
    /// Replaces the pair by the pair at twice its size.
    Double,
    /// Loads this frame into the backend; the stages that follow work on it.
    Enter(usize),
    /// Runs a stage.
    Run(Run),
    /// Frees data after their last use.
    Free(Data),
    /// An iteration is done.
    Iteration,
    /// If message passing has settled, skips to [`Step::EndOfPhase`].
    Settled,
    /// Ends a phase that may settle.
    EndOfPhase,
    /// Starts the maps of the whole image, which this frame describes; tiles will fill them.
    Mosaic(usize),
    /// Copies the frame's maps of a view into the maps of the whole image.
    Place(View),
    /// Ends the tiles; the stages that follow work on the maps of the whole image.
    Gather,
    /// Takes what the maps of the whole image were filled with as the guess for the tiles that follow, which fill these maps again.
    LookAgain,
    /// Replaces the disparities of the left view in the maps of the whole image by those of the right view.
    PlaceRight,
    /// Requests the maps of a view.
    Ask(View),
    /// Waits for the requested maps.
    Collect,
    /// Merges the maps of both sizes.
    Join,
}

impl Step {
    /// A run of `stage`.
    #[must_use]
    pub fn of(stage: Stage) -> Self {
        Self::Run(stage.into())
    }

    /// The stage that it runs, if any.
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
    /// The frames that the steps enter.
    pub frames: Vec<Frame>,
    /// The steps.
    pub steps: Vec<Step>,
}

impl Program {
    /// Whether the only wait is the last step, for the maps; before it, the host never waits for the backend.
    #[must_use]
    pub fn waits_once(&self) -> bool {
        let waits = |step: &Step| matches!(step, Step::Collect | Step::Place(_));
        self.steps.iter().position(waits) == Some(self.steps.len() - 1)
    }

    /// Replaces the measurement of the corrections by those that are `known`, if any.
    #[must_use]
    pub fn corrected(mut self, known: Option<Conditioning>) -> Self {
        if let Some(known) = known {
            self.steps
                .iter_mut()
                .filter(|step| **step == Step::Condition)
                .for_each(|step| *step = Step::Correct(known));
        }
        self
    }

    /// Adds the `prior` of the scene, if any, as soon as the pair is conditioned. The plans must [have](Plan::with_prior) one then.
    #[must_use]
    pub fn knowing(mut self, prior: Option<Arc<Prior>>) -> Self {
        let conditions = |step: &Step| matches!(step, Step::Condition | Step::Correct(_));
        if let Some((prior, at)) = prior.zip(self.steps.iter().position(conditions)) {
            self.steps.insert(at + 1, Step::Know(prior));
        }
        self
    }

    /// Each step with the plan of the current frame (the first one until a frame is entered).
    pub fn with_plans(&self) -> impl Iterator<Item = (&Step, &Plan)> {
        let mut frame = 0;
        self.steps.iter().map(move |step| {
            if let Step::Enter(entered) | Step::Mosaic(entered) = step {
                frame = *entered;
            }
            (step, &self.frames[frame].plan)
        })
    }

    /// Approximate time on one thread, in ns.
    #[must_use]
    pub fn work(&self) -> f64 {
        let runs = self.with_plans().map(|(step, plan)| match step {
            Step::Run(run) => run.work(plan),
            _ => 0.0,
        });
        runs.sum()
    }

    /// The same match after `pass`, which rewrites the steps of each entered frame and may change its plan.
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
