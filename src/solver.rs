//! The schedule: the only place that knows levels, iterations, convergence and the order of what follows.
//!
//! [`estimate`] takes a prepared pair to the disparity of every pixel, [`post_processing`] says what follows.

use crate::backend::wavefront::Wavefront;
use crate::backend::{Backend, Stage};
use crate::error::Result;
use crate::front::Prepared;
use crate::options::{Fill, Median, Method, Order};
use crate::plan::{Phase, Plan};
use crate::watch::Watch;
use std::iter;

/// What an inspector sees of a match on its way.
pub enum Inspection<'a> {
    /// The pair as it is matched, with what follows from it.
    Prepared(&'a Prepared),
    /// A stage has run.
    Stage(&'a mut dyn Backend, Stage),
    /// This many iterations are done.
    Iteration(&'a mut dyn Backend, u32),
}

/// Looks into a match on its way, for diagnosis: it may read any volume and map, at the price of time.
pub type Inspector<'a> = &'a mut (dyn FnMut(&mut Inspection) -> Result<()> + Send);

/// One match on its way: who watches it, and who looks in.
pub struct Run<'a, 'b> {
    /// Progress and time.
    pub watch: Watch<'a>,
    /// Looks in, if anyone.
    pub inspector: Option<Inspector<'b>>,
    /// Stages that go down the image together, once all are known.
    together: Option<Vec<Stage>>,
}

impl<'a, 'b> Run<'a, 'b> {
    /// A match that `watch` follows, and `inspector`, if any, looks into.
    #[must_use]
    pub fn new(watch: Watch<'a>, inspector: Option<Inspector<'b>>) -> Self {
        Self { watch, inspector, together: None }
    }

    /// Runs `stage`, and shows it.
    ///
    /// # Errors
    /// Those of the backend and of the inspector, and [`crate::Error::Interrupted`] when the observer breaks.
    pub async fn stage(&mut self, backend: &mut dyn Backend, plan: &Plan, stage: Stage) -> Result<()> {
        if let Some(together) = &mut self.together {
            together.push(stage);
            return Ok(());
        }
        self.watch.begin(stage.name(), work_of(plan, stage))?;
        backend.run(stage)?;
        backend.keep_up().await?;
        self.inspect(&mut Inspection::Stage(backend, stage))
    }

    /// Runs the stages that were gathered since `together` began, if it did.
    async fn run_together(&mut self, backend: &mut dyn Backend, plan: &Plan) -> Result<()> {
        let Some(stages) = self.together.take() else { return Ok(()) };
        let wavefront = Wavefront::new(plan, stages).expect("stages that go row by row");
        let watch = &mut self.watch;
        let mut before = |stage: Stage, share| watch.begin(stage.name(), share * work_of(plan, stage));
        backend.run_wavefront(&wavefront, &mut before).await
    }

    fn inspect(&mut self, inspection: &mut Inspection) -> Result<()> {
        self.inspector.as_mut().map_or(Ok(()), |inspector| inspector(inspection))
    }
}

/// From a prepared pair to the disparity of every pixel of the left view, and where the method asks for it of the right one;
/// returns the number of iterations, [`Backend::idle_iterations`] included.
///
/// # Errors
/// Those of [`Run::stage`].
pub async fn estimate(
    backend: &mut dyn Backend,
    plan: &Plan,
    prepared: Prepared,
    run: &mut Run<'_, '_>,
) -> Result<u32> {
    run.inspect(&mut Inspection::Prepared(&prepared))?;
    run.watch.host("upload", || backend.prepare(plan, prepared))?;
    for z in 0..plan.levels.len() {
        run.stage(backend, plan, Stage::Graph(z)).await?;
    }
    let costs = (0..plan.levels.len()).flat_map(|z| {
        let cost = if z == 0 { Stage::Cost } else { Stage::Pyramid(z) };
        iter::once(cost).chain(plan.limits_labels().then_some(Stage::LabelRange(z)))
    });
    for stage in costs {
        run.stage(backend, plan, stage).await?;
    }
    let join =
        async |backend: &mut dyn Backend, run: &mut Run<'_, '_>, z: usize| join(backend, plan, run, z).await;
    let iterations = flood(backend, plan, run, join).await?;
    for stage in read_out(plan) {
        run.stage(backend, plan, stage).await?;
    }
    run.run_together(backend, plan).await?;
    Ok(iterations)
}

/// What happens when level `z` joins the flooding: it gets its labels and their evidence.
///
/// # Errors
/// Those of [`Run::stage`].
pub async fn join(backend: &mut dyn Backend, plan: &Plan, run: &mut Run<'_, '_>, z: usize) -> Result<()> {
    run.stage(backend, plan, Stage::LabelWindow(z)).await?;
    if z == 0 && !plan.holds_all_rows() {
        run.together = Some(Vec::new());
    }
    run.stage(backend, plan, Stage::Evidence(z)).await
}

/// Runs the flooding of `plan`; `join` is called for each level that joins, coarsest first. Returns the number of iterations,
/// [`Backend::idle_iterations`] included.
///
/// # Errors
/// Those of [`estimate`] and of `join`.
pub async fn flood<'a, 'b>(
    backend: &mut dyn Backend,
    plan: &Plan,
    run: &mut Run<'a, 'b>,
    join: impl AsyncFn(&mut dyn Backend, &mut Run<'a, 'b>, usize) -> Result<()>,
) -> Result<u32> {
    let mut iterations = 0;
    let mut joined = plan.levels.len();
    for phase in &plan.phases {
        for z in (phase.finest..joined).rev() {
            join(backend, run, z).await?;
        }
        joined = phase.finest;
        for stage in joining(plan, phase) {
            run.stage(backend, plan, stage).await?;
        }
        let may_settle = plan.settled_change().is_some() && phase.finest == 0;
        if may_settle {
            run.stage(backend, plan, Stage::Change).await?;
        }
        for i in 0..phase.iterations {
            iterations += 1;
            for stage in iteration(plan, phase, i) {
                run.stage(backend, plan, stage).await?;
            }
            run.inspect(&mut Inspection::Iteration(backend, iterations))?;
            if may_settle {
                run.stage(backend, plan, Stage::Change).await?;
                // Who looks in sees no idle iterations, at the price of time.
                if backend.settled(run.inspector.is_some()).await? {
                    break;
                }
            }
        }
    }
    Ok(iterations)
}

/// The stages by which what the coarser levels know reaches the one that joins in a phase, before its own messages start. The
/// coarser level's beliefs take in what came up, or the next resolution would take off a message that they do not hold.
fn joining(plan: &Plan, phase: &Phase) -> Vec<Stage> {
    let (joining, above) = (phase.finest, phase.finest + 1);
    if above == plan.levels.len() || plan.phases.len() == 1 {
        return Vec::new();
    }
    vec![Stage::Resolution(above), Stage::Belief(joining), Stage::Belief(above)]
}

/// The same plan for a match that nobody looks into: where the schedule allows it, the stages that need level 0 go down the
/// image together, and only the rows between them are held.
#[must_use]
pub fn streamed(plan: &Plan) -> Plan {
    let method = &plan.method;
    let Some(last) = plan.phases.last() else { return plan.clone() };
    // Convergence looks at the whole level, and so do zones and some matching costs.
    let whole = plan.phases.len() == 1
        || method.schedule.tolerance > 0.0
        || plan.limits_labels()
        || !method.cost.matching.facts().by_rows;
    let stages = iter::once(Stage::Evidence(0))
        .chain(joining(plan, last))
        .chain((0..last.iterations).flat_map(|i| iteration(plan, last, i)))
        .chain(read_out(plan));
    let wavefront = if whole { None } else { Wavefront::new(plan, stages.collect()) };
    let streamed = wavefront.map(|wavefront| Plan { held: wavefront.rows(), ..plan.clone() });
    // With few labels the costs take less than what they are computed from.
    streamed.filter(|streamed| streamed.bytes() < plan.bytes()).unwrap_or_else(|| plan.clone())
}

/// The stages of iteration `i`, from 0 on, of a phase. Every message is from old beliefs: those between levels first, then a
/// level's own and its new beliefs.
fn iteration(plan: &Plan, phase: &Phase, i: u32) -> impl Iterator<Item = Stage> + use<> {
    let (finest, coarsest) = (phase.finest, plan.levels.len() - 1);
    // The coarsest levels that are coarsest_resolution and that are flooded.
    let (exchanged, flooded) = match plan.method.schedule.order {
        Order::Together => (coarsest, coarsest),
        // What joining has just coarsest_resolution would give the same messages again.
        Order::CoarseFirst if finest > 0 => (if i == 0 { finest } else { coarsest }, coarsest),
        // The coarser levels have settled: they and level 0 speak in turns. A level that is farther away than messages
        // between levels still go has no say any more.
        Order::CoarseFirst => {
            let reach = coarsest.min((phase.iterations / 2 - i / 2) as usize);
            if i.is_multiple_of(2) { (0, reach) } else { (reach, 0) }
        }
    };
    (finest + 1..=exchanged).map(Stage::Resolution).chain((finest..=flooded).map(Stage::Flood))
}

/// What follows the labels and looks at volumes.
fn read_out(plan: &Plan) -> Vec<Stage> {
    let right = plan.reads_right_view().then_some(Stage::RightView);
    iter::once(Stage::WinnerTakesAll).chain(right).chain([Stage::SubPixel]).collect()
}

/// The stages that follow [`estimate`], in order. They look at maps alone.
#[must_use]
pub fn post_processing(method: &Method) -> Vec<Stage> {
    let mut stages = vec![Stage::LeftRightCheck];
    if method.refinement.speckle_size > 0 {
        stages.push(Stage::SpeckleFilter);
    }
    stages.push(Stage::Confidence);
    match method.refinement.fill {
        Fill::None => {}
        Fill::Row => stages.push(Stage::Fill),
        Fill::Votes => stages.extend([Stage::Fill, Stage::VoteFill, Stage::FillPlane]),
    }
    if method.refinement.median != Median::Off {
        stages.push(if method.refinement.plane { Stage::Plane } else { Stage::Median });
    }
    stages
}

fn cells(plan: &Plan, level: usize) -> f64 {
    (plan.levels[level].pixels() * plan.levels[level].stride) as f64
}

fn work_of(plan: &Plan, stage: Stage) -> f64 {
    match stage {
        Stage::Cost => cells(plan, 0),
        Stage::Pyramid(z) | Stage::Flood(z) | Stage::Dependency(z) => cells(plan, z),
        _ => 0.0,
    }
}

/// The stages that make the right view the left one, between its labels, once the left view's maps have been asked for, in
/// order. They look at volumes, and [`post_processing`] follows.
#[must_use]
pub fn right_view() -> [Stage; 3] {
    [Stage::SwapViews, Stage::Cost, Stage::SubPixel]
}

/// The work of a match by `plan`, in cells (pixels times labels) of dependency messages, which take nearly all the time.
#[must_use]
pub fn work(plan: &Plan) -> f64 {
    let all: f64 = (0..plan.levels.len()).map(|z| cells(plan, z)).sum();
    let iterations = plan.phases.iter().flat_map(|phase| (0..phase.iterations).map(move |i| (phase, i)));
    let stages = iterations.flat_map(|(phase, i)| iteration(plan, phase, i));
    all + stages.map(|stage| work_of(plan, stage)).sum::<f64>()
}
