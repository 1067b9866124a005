//! A pair through a backend: in one piece, or tile by tile; and at twice its size too, where the method says so.

mod double_size;

use crate::backend::{Backend, Stage, Ticket, Traffic};
use crate::error::{Error, Purpose, Result};
use crate::front::conditioning::Conditioning;
use crate::front::{self, Prepared};
use crate::image::Pair;
use crate::maps::{Maps, RightMap, flag};
use crate::memory;
use crate::options::LeftRightCheck;
use crate::plan::Plan;
use crate::solver::{self, Inspector, Run};
use crate::tiles::Tiles;
use crate::tiles::mosaic::Mosaic;
use crate::watch::{Observer, Progress, Watch};
use std::ops::ControlFlow;
use std::time::Duration;
use web_time::Instant;

/// What a match leaves behind.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The maps.
    pub maps: Maps,
    /// Iterations done, of all phases together; the most of any tile.
    pub iterations: u32,
    /// What was corrected in the pair.
    pub conditioning: Conditioning,
    /// What the host did around the stages, and how long it took.
    pub host_times: Vec<(&'static str, Duration)>,
    /// The time of every stage that ran on the maps of all tiles.
    pub mosaic_times: Vec<(Stage, Duration)>,
    /// What went through the device.
    pub traffic: Traffic,
    /// [`Backend::cells`] of each level, at the pair's own size; those of all tiles together.
    pub cells: Vec<u64>,
}

/// Matches `pair` by `plan` on `backend`; `observer` hears of progress.
///
/// # Errors
/// Whatever the backend reports, [`crate::Error::Mismatch`] when the plan is for another size, and
/// [`crate::Error::Interrupted`] when `observer` breaks.
pub async fn solve(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
) -> Result<Solution> {
    inspect(backend, plan, pair, observer, None).await
}

/// As [`solve`], and `inspector`, if any, looks into the match on its way.
///
/// # Errors
/// Those of [`solve`] and of `inspector`.
pub async fn inspect(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
    inspector: Option<Inspector<'_>>,
) -> Result<Solution> {
    let Some(double) = Double::of(plan)? else {
        return in_one_piece(backend, plan, pair, observer, inspector).await;
    };
    let own = in_one_piece(backend, plan, pair, &mut double.first(observer), inspector).await?;
    double.solve(backend, pair, own, observer).await
}

/// A match at twice the size of the pair, which follows that at its own size.
struct Double {
    tiles: Tiles,
    /// The share of the work that is done before.
    before: f64,
}

impl Double {
    /// That which the method of `plan` asks for.
    fn of(plan: &Plan) -> Result<Option<Self>> {
        let Some(double) = plan.doubled()? else { return Ok(None) };
        let [own, work] = [plan, &double].map(|plan| matchings(plan) as f64 * solver::work(plan));
        Ok(Some(Self { tiles: Tiles::new(&double)?, before: own / (own + work) }))
    }

    /// What observes the match at the own size, where `observer` observes both.
    fn first<'a>(&self, observer: Observer<'a>) -> impl FnMut(Progress) -> ControlFlow<()> + Send + use<'a> {
        let before = self.before;
        move |progress| observer(Progress { done: before * progress.done, ..progress })
    }

    /// Takes what is found at twice the size into `own`.
    async fn solve(
        &self,
        backend: &mut dyn Backend,
        pair: &Pair,
        mut own: Solution,
        observer: Observer<'_>,
    ) -> Result<Solution> {
        let then = |done: f64| self.before + (1.0 - self.before) * done;
        let mut observer = |progress: Progress| observer(Progress { done: then(progress.done), ..progress });
        let mut watch = Watch::new(&mut observer, 1.0);
        let pair = watch.host("double_size", || front::doubled(pair, &own.conditioning))?;
        own.host_times.extend(watch.into_times());
        let double = if self.tiles.count() == 1 {
            in_one_piece(backend, self.tiles.whole(), &pair, &mut observer, None).await?
        } else {
            in_tiles(backend, &self.tiles, &pair, &mut observer).await?
        };
        let clock = Instant::now();
        double_size::take_in(&mut own.maps, &double.maps);
        own.host_times.push(("double_size", clock.elapsed()));
        own.host_times.extend(double.host_times);
        own.iterations += double.iterations;
        own.mosaic_times.extend(double.mosaic_times);
        own.traffic += double.traffic;
        Ok(own)
    }
}

/// Matches `pair` at its own size, in one piece.
async fn in_one_piece(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
    inspector: Option<Inspector<'_>>,
) -> Result<Solution> {
    let mut run = Run::new(watch(plan, observer), inspector);
    let (pair, conditioning) = front::condition(pair, plan, &mut run.watch)?;
    let (iterations, tickets) = whole(backend, plan, pair, &mut run).await?;
    backend.wait().await?;
    let (maps, idle) = run.watch.host_async("download", tickets.collect(backend)).await?;
    let iterations = iterations - idle;
    let (traffic, cells, host_times) = (backend.traffic(), backend.cells(), run.watch.into_times());
    Ok(Solution { maps, iterations, conditioning, host_times, mosaic_times: Vec::new(), traffic, cells })
}

/// A match whose stages may still run, or whose maps are on their way.
pub struct Started {
    tickets: Tickets,
    iterations: u32,
    conditioning: Conditioning,
    host_times: Vec<(&'static str, Duration)>,
    traffic: Traffic,
    cells: Vec<u64>,
}

/// As [`solve`], at the pair's own size alone, but does not wait for a device: the next match may be started on it before [`finish`]
/// ends this one.
///
/// # Errors
/// Those of [`solve`].
pub async fn start(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: &Pair,
    observer: Observer<'_>,
) -> Result<Started> {
    let mut run = Run::new(watch(plan, observer), None);
    let (pair, conditioning) = front::condition(pair, plan, &mut run.watch)?;
    let (iterations, tickets) = whole(backend, plan, pair, &mut run).await?;
    let (traffic, cells) = (backend.traffic(), backend.cells());
    Ok(Started { tickets, iterations, conditioning, host_times: run.watch.into_times(), traffic, cells })
}

/// Ends a match that was started on `backend`.
///
/// # Errors
/// Whatever the backend reports.
pub async fn finish(backend: &mut dyn Backend, started: Started) -> Result<Solution> {
    let Started { tickets, iterations, conditioning, host_times, traffic, cells } = started;
    let (maps, idle) = tickets.collect(backend).await?;
    let iterations = iterations - idle;
    Ok(Solution { maps, iterations, conditioning, host_times, mosaic_times: Vec::new(), traffic, cells })
}

/// How often a pair is matched: once more, mirrored, where that is how its right view is found.
fn matchings(plan: &Plan) -> usize {
    if plan.method.refinement.left_right_check == LeftRightCheck::SecondMatch { 2 } else { 1 }
}

fn watch<'a>(plan: &Plan, observer: Observer<'a>) -> Watch<'a> {
    Watch::new(observer, matchings(plan) as f64 * solver::work(plan))
}

/// The maps of both views, asked for.
struct Tickets {
    left: Ticket,
    /// Of the right view, which is mirrored.
    right: Option<Ticket>,
}

impl Tickets {
    /// The maps, and how many iterations were idle.
    async fn collect(self, backend: &mut dyn Backend) -> Result<(Maps, u32)> {
        let (mut maps, idle) = backend.maps(self.left).await?;
        if let Some(right) = self.right {
            maps.right = Some(right_map(backend.maps(right).await?.0));
        }
        Ok((maps, idle))
    }
}

/// The map of the right view, from maps of what is mirrored.
fn right_map(maps: Maps) -> RightMap {
    RightMap {
        disparity: maps.disparity.mirrored(),
        // How far a runner-up is behind is not known.
        validity: maps.validity.mirrored().map(|validity| validity & !flag::LOW_CONFIDENCE),
    }
}

/// What `make` makes of a pair: a pair for `plan`, if the memory holds one more.
fn copy(plan: &Plan, make: impl FnOnce() -> Pair) -> Result<Pair> {
    memory::check(plan.pair_bytes(), Purpose::Match)?;
    Ok(make())
}

/// What a match of `pair` needs, in the place of what the last match needed.
fn prepare(backend: &mut dyn Backend, plan: &Plan, pair: Pair, run: &mut Run) -> Result<Prepared> {
    backend.release();
    front::prepare(pair, plan, &mut run.watch)
}

/// All stages of a match in one piece; the number of iterations, and its maps.
async fn whole(
    backend: &mut dyn Backend,
    plan: &Plan,
    pair: Pair,
    run: &mut Run<'_, '_>,
) -> Result<(u32, Tickets)> {
    let plan = &if run.inspector.is_some() { plan.clone() } else { solver::streamed(plan) };
    if matchings(plan) == 2 {
        // The right view becomes the left one, its matches to the left again, when both are mirrored.
        let inspector = run.inspector.take();
        let mirrored = copy(plan, || pair.mirrored())?;
        let mirrored = prepare(backend, plan, mirrored, run)?;
        solver::estimate(backend, plan, mirrored, run).await?;
        run.stage(backend, plan, Stage::MirrorLabels).await?;
        run.inspector = inspector;
    }
    let prepared = prepare(backend, plan, pair, run)?;
    let iterations = solver::estimate(backend, plan, prepared, run).await?;
    for stage in solver::post_processing(&plan.method) {
        run.stage(backend, plan, stage).await?;
    }
    let mut tickets = Tickets { left: backend.request_maps()?, right: None };
    if plan.method.refinement.right_map {
        for stage in solver::right_view().into_iter().chain(solver::post_processing(&plan.method)) {
            run.stage(backend, plan, stage).await?;
        }
        tickets.right = Some(backend.request_maps()?);
    }
    Ok((iterations, tickets))
}

/// Matches `pair` tile by tile on `backend`, and finishes the maps of all tiles together on the CPU path; `observer` hears
/// of progress.
///
/// # Errors
/// Those of [`solve`].
pub async fn solve_tiles(
    backend: &mut dyn Backend,
    tiles: &Tiles,
    pair: &Pair,
    observer: Observer<'_>,
) -> Result<Solution> {
    let Some(double) = Double::of(tiles.whole())? else {
        return in_tiles(backend, tiles, pair, observer).await;
    };
    let own = in_tiles(backend, tiles, pair, &mut double.first(observer)).await?;
    double.solve(backend, pair, own, observer).await
}

/// Matches `pair` at its own size, tile by tile.
async fn in_tiles(
    backend: &mut dyn Backend,
    tiles: &Tiles,
    pair: &Pair,
    observer: Observer<'_>,
) -> Result<Solution> {
    let whole = tiles.whole();
    let all: f64 = tiles.list().iter().map(|tile| solver::work(&tile.plan)).sum();
    let mut watch = Watch::new(observer, matchings(whole) as f64 * all);
    let (pair, conditioning) = front::condition(pair, whole, &mut watch)?;
    let mut run = Run::new(watch.in_tiles(matchings(whole) * tiles.count()), None);
    let mut mosaic = Mosaic::new(whole, &pair)?;
    let (mut iterations, mut traffic) = (0, Traffic::default());
    let mut cells = vec![0; whole.levels.len()];
    let right_map_wanted = whole.method.refinement.right_map;
    if matchings(whole) == 2 {
        for tile in tiles.list() {
            run.watch.next_tile();
            let crop = copy(&tile.plan, || pair.crop(&tile.crop.mirrored(pair.size().0)))?;
            let mirrored = copy(&tile.plan, || crop.mirrored())?;
            drop(crop);
            let plan = solver::streamed(&tile.plan);
            let prepared = prepare(backend, &plan, mirrored, &mut run)?;
            solver::estimate(backend, &plan, prepared, &mut run).await?;
            backend.wait().await?;
            run.watch.host_async("download", mosaic.place_mirrored(tile, backend)).await?;
            traffic += backend.traffic();
        }
    }
    for tile in tiles.list() {
        run.watch.next_tile();
        let crop = copy(&tile.plan, || pair.crop(&tile.crop))?;
        let plan = solver::streamed(&tile.plan);
        let prepared = prepare(backend, &plan, crop, &mut run)?;
        let matched = prepared.pair.clone();
        let all = solver::estimate(backend, &plan, prepared, &mut run).await?;
        iterations = iterations.max(all - backend.idle_iterations().await?);
        backend.wait().await?;
        let seen = run.watch.host_async("download", mosaic.place(tile, &matched, backend)).await?;
        if right_map_wanted && matchings(whole) == 1 {
            for stage in solver::right_view() {
                run.stage(backend, &plan, stage).await?;
            }
            backend.wait().await?;
            run.watch.host_async("download", mosaic.place_right(tile, &seen, backend)).await?;
        }
        traffic += backend.traffic();
        cells.iter_mut().zip(backend.cells()).for_each(|(sum, of_tile)| *sum += of_tile);
    }
    run.watch.end_tiles();
    let mut mosaic_times = Vec::new();
    let mut finish = |mosaic: &mut Mosaic| {
        for stage in solver::post_processing(&whole.method) {
            run.watch.begin(stage.name(), 0.0)?;
            let clock = Instant::now();
            mosaic.run(stage);
            mosaic_times.push((stage, clock.elapsed()));
        }
        Ok::<_, Error>(mosaic.take_maps())
    };
    let mut maps = finish(&mut mosaic)?;
    if right_map_wanted {
        mosaic.swap_views();
        maps.right = Some(right_map(finish(&mut mosaic)?));
    }
    let host_times = run.watch.into_times();
    Ok(Solution { maps, iterations, conditioning, host_times, mosaic_times, traffic, cells })
}
