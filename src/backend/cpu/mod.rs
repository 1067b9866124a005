//! The CPU path: every stage, parallel over rows, its inner loops over labels.

mod belief;
mod confidence;
mod cost;
mod dependency;
mod evidence;
mod fill;
mod flood;
mod label_range;
mod left_right_check;
mod median;
mod mosaic;
mod pages;
mod pyramid;
mod resolution;
mod speckle_filter;
mod sub_pixel;
mod units;
mod winner_takes_all;

use super::{Backend, Map, PaddedRows, Requested, Stage, Traffic, Volume, volume_shape};
use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::{Image, Pair, Plane, Rect};
use crate::maps::Maps;
use crate::memory;
use crate::plan::{COST_FRACTION_BITS, COST_MAX, Plan, VolumeWidth};
use belief::Summands;
pub use mosaic::Mosaic;
use pages::Pages;
use rayon::prelude::*;
use std::hint::black_box;
use std::mem;
use std::time::{Duration, Instant};
use units::Units;

/// What [`Cpu::copy_rate`] copies, and how often.
const COPIED_BYTES: usize = 1 << 28;
const COPY_TRIES: usize = 8;

/// The CPU path.
#[derive(Default)]
pub struct Cpu {
    state: Option<State>,
    times: Option<Vec<(Stage, Duration)>>,
}

impl Cpu {
    /// The rate at which the threads of the current pool copy from one buffer to another, both larger than caches are:
    /// bytes read and written a second, the best of a few tries.
    #[must_use]
    pub fn copy_rate() -> f64 {
        let from = vec![1u8; COPIED_BYTES];
        let mut to = vec![0u8; COPIED_BYTES];
        // A piece a thread: what copies long runs goes past the caches.
        let piece = COPIED_BYTES.div_ceil(rayon::current_num_threads());
        let mut rate = || {
            let start = Instant::now();
            to.par_chunks_mut(piece)
                .zip(from.par_chunks(piece))
                .for_each(|(to, from)| to.copy_from_slice(from));
            black_box(&mut to);
            (2 * COPIED_BYTES) as f64 / start.elapsed().as_secs_f64()
        };
        (0..COPY_TRIES).map(|_| rate()).fold(0.0, f64::max)
    }
}

/// Volumes in the width that the plan asks for.
enum State {
    Narrow(Volumes<u8>),
    Wide(Volumes<u16>),
}

/// All volumes of a match.
struct Volumes<U> {
    plan: Plan,
    pair: Pair,
    /// Cost of level 0; coarser ones are in `levels`.
    fine_cost: Pages<u8>,
    levels: Vec<Level<U>>,
    /// First and last label of each pixel, by level; empty where all labels are in question.
    label_ranges: Vec<Plane<[u16; 2]>>,
    /// Label map of the last change, and its sum.
    labels: Vec<u16>,
    change: u64,
    maps: Finest,
}

/// What the finest level knows of each pixel, at last.
struct Finest {
    optima: Plane<Optimum>,
    right: Plane<u16>,
    /// Belief of the right labels.
    right_best: Plane<u16>,
    raw: Plane<i32>,
    disparity: Plane<i32>,
    validity: Plane<u8>,
    confidence: Plane<u8>,
}

/// The belief of one pixel around its optimum, in units.
#[derive(Clone, Copy, Default)]
struct Optimum {
    label: u16,
    best: u16,
    runner_up: u16,
}

impl Finest {
    fn new((width, height): (usize, usize)) -> Self {
        Self {
            optima: Plane::filled(width, height, Optimum::default()),
            right: Plane::filled(width, height, 0),
            right_best: Plane::filled(width, height, 0),
            raw: Plane::filled(width, height, 0),
            disparity: Plane::filled(width, height, 0),
            validity: Plane::filled(width, height, 0),
            confidence: Plane::filled(width, height, 0),
        }
    }

    fn read(&self, map: Map) -> Plane<i32> {
        match map {
            Map::Label => self.optima.map(|p| p.label.into()),
            Map::Best => self.optima.map(|p| p.best.into()),
            Map::RunnerUp => self.optima.map(|p| p.runner_up.into()),
            Map::RightLabel => self.right.map(|&v| v.into()),
            Map::RightBest => self.right_best.map(|&v| v.into()),
            Map::Raw => self.raw.clone(),
            Map::Disparity => self.disparity.clone(),
            Map::Validity => self.validity.map(|&v| v.into()),
            Map::Confidence => self.confidence.map(|&v| v.into()),
        }
    }

    fn write(&mut self, map: Map, values: &Plane<i32>) {
        assert_eq!(self.optima.size(), values.size(), "a map of the size of the images");
        self.write_part(map, values, &Rect::whole(values.size()), (0, 0));
    }

    /// Replaces the values of `map` from `corner` on by `part` of `values`.
    fn write_part(&mut self, map: Map, values: &Plane<i32>, part: &Rect, corner: (usize, usize)) {
        fn put<T>(
            plane: &mut Plane<T>,
            (values, part, (x, y)): (&Plane<i32>, &Rect, (usize, usize)),
            set: impl Fn(&mut T, i32),
        ) {
            for (row, y) in part.y.clone().zip(y..) {
                let old = plane.row_mut(y)[x..].iter_mut();
                old.zip(&values.row(row)[part.x.clone()]).for_each(|(old, &new)| set(old, new));
            }
        }
        let from = (values, part, corner);
        match map {
            Map::Label => put(&mut self.optima, from, |p, v| p.label = v as u16),
            Map::Best => put(&mut self.optima, from, |p, v| p.best = v as u16),
            Map::RunnerUp => put(&mut self.optima, from, |p, v| p.runner_up = v as u16),
            Map::RightLabel => put(&mut self.right, from, |old, v| *old = v as u16),
            Map::RightBest => put(&mut self.right_best, from, |old, v| *old = v as u16),
            Map::Raw => put(&mut self.raw, from, |old, v| *old = v),
            Map::Disparity => put(&mut self.disparity, from, |old, v| *old = v),
            Map::Validity => put(&mut self.validity, from, |old, v| *old = v as u8),
            Map::Confidence => put(&mut self.confidence, from, |old, v| *old = v as u8),
        }
    }

    /// Runs a stage that needs maps and the left view alone: those after [`Stage::SubPixel`].
    fn run(&mut self, plan: &Plan, left: &Image, stage: Stage) {
        match stage {
            Stage::LeftRightCheck => left_right_check::run(plan, left, self),
            Stage::SpeckleFilter => speckle_filter::run(plan.method.refinement.speckle_size as usize, self),
            Stage::Confidence => confidence::run(plan.method.refinement.confidence_floor, self),
            Stage::Fill => fill::run(self),
            Stage::FillMedian => median::fill(plan, left, self),
            Stage::Median => median::run(plan, left, self),
            _ => unreachable!("{stage:?} needs volumes"),
        }
    }
}

/// Volumes of one level, each \[y\]\[x\]\[slot\]\[label\] with padded labels.
struct Level<U> {
    graph: LevelGraph,
    /// In 1/256 cost units; empty at level 0.
    cost: Pages<u16>,
    evidence: Pages<u8>,
    dependency: Pages<U>,
    /// Whether a dependency factor has spoken yet: until then all messages are 0, whatever is stored.
    spoken: bool,
    /// The same of the resolution factors between this level and the next finer one: of its `up` and that one's `down`.
    resolved: bool,
    /// Empty at the coarsest level.
    down: Pages<U>,
    /// Empty at level 0.
    up: Pages<U>,
    belief: Pages<U>,
}

impl<U: Units> Volumes<U> {
    fn new(plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<Self> {
        let last = plan.levels.len() - 1;
        let levels = graphs
            .into_iter()
            .enumerate()
            .map(|(z, graph)| {
                let level = &plan.levels[z];
                let cells = level.pixels() * level.stride;
                Ok(Level {
                    cost: Pages::new(if z == 0 { 0 } else { cells })?,
                    evidence: Pages::new(cells)?,
                    dependency: Pages::new(cells * graph.slots())?,
                    spoken: false,
                    resolved: false,
                    down: Pages::new(if z == last { 0 } else { cells })?,
                    up: Pages::new(if z == 0 { 0 } else { cells })?,
                    belief: Pages::new(cells)?,
                    graph,
                })
            })
            .collect::<Result<_>>()?;
        let fine = &plan.levels[0];
        Ok(Self {
            plan: plan.clone(),
            pair: pair.clone(),
            fine_cost: Pages::new(fine.pixels() * fine.stride)?,
            levels,
            label_ranges: Vec::new(),
            labels: vec![0; fine.pixels()],
            change: 0,
            maps: Finest::new(plan.size()),
        })
    }

    /// Ready for another pair whose plan fits, as [`Self::new`] would be.
    fn reset(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) {
        self.plan = plan.clone();
        self.pair = pair.clone();
        self.labels.fill(0);
        for (level, graph) in self.levels.iter_mut().zip(graphs) {
            (level.graph, level.spoken, level.resolved) = (graph, false, false);
        }
    }

    fn poison(&mut self, byte: u8) {
        let wide = u16::from_ne_bytes([byte; 2]);
        self.fine_cost.fill(byte);
        self.labels.fill(wide);
        for level in &mut self.levels {
            level.cost.fill(wide);
            level.evidence.fill(byte);
            (level.spoken, level.resolved) = (true, true);
            level.belief.fill(U::of(u32::from(wide) & Into::<u32>::into(U::MOST)));
            for messages in [&mut level.dependency, &mut level.down, &mut level.up] {
                messages.fill(U::of(u32::from(wide) & Into::<u32>::into(U::MOST)));
            }
        }
        for map in Map::ALL {
            let (width, height) = self.plan.size();
            self.maps.write(map, &Plane::filled(width, height, i32::from_ne_bytes([byte; 4])));
        }
    }

    fn run(&mut self, stage: Stage) {
        let Self { plan, pair, fine_cost, levels, label_ranges, labels, change, maps } = self;
        match stage {
            Stage::Cost => cost::run(plan, pair, fine_cost),
            Stage::Pyramid(z) => {
                let (finer, coarser) = levels.split_at_mut(z);
                let out = &mut coarser[0].cost;
                if z == 1 {
                    pyramid::run(plan, z, fine_cost, out);
                } else {
                    pyramid::run(plan, z, &finer[z - 1].cost, out);
                }
            }
            Stage::LabelRange(0) => label_range::run(&plan.levels[0], &label_ranges[0], fine_cost, COST_MAX),
            Stage::LabelRange(z) => {
                let highest = u16::from(COST_MAX) << COST_FRACTION_BITS;
                label_range::run(&plan.levels[z], &label_ranges[z], &mut levels[z].cost, highest);
            }
            Stage::Evidence(z) => {
                let l = &mut levels[z];
                if z == 0 {
                    evidence::run(&plan.levels[z], fine_cost, &mut l.evidence, &mut l.belief);
                } else {
                    evidence::run(&plan.levels[z], &l.cost, &mut l.evidence, &mut l.belief);
                }
            }
            Stage::Dependency(z) => {
                let l = &mut levels[z];
                let fresh = !mem::replace(&mut l.spoken, true);
                dependency::run(plan, z, &l.graph, &l.belief, &mut l.dependency, fresh);
            }
            Stage::Resolution(z) => {
                let (finer, coarser) = levels.split_at_mut(z);
                let (fine, coarse) = (&mut finer[z - 1], &mut coarser[0]);
                let fresh = !mem::replace(&mut coarse.resolved, true);
                let beliefs = [&*fine.belief, &*coarse.belief];
                resolution::run(plan, z, beliefs, &mut fine.down, &mut coarse.up, fresh);
            }
            Stage::Belief(z) | Stage::Flood(z) => {
                let above = levels.get(z + 1).is_some_and(|above| above.resolved);
                let l = &mut levels[z];
                // What holds nothing yet is no summand.
                let down: &[U] = if above { &l.down } else { &[] };
                let up: &[U] = if l.resolved { &l.up } else { &[] };
                let summands = Summands::new(plan, z, &l.graph, &l.evidence, [down, up]);
                if matches!(stage, Stage::Belief(_)) {
                    belief::run(&summands, l.spoken.then_some(&*l.dependency), &mut l.belief);
                } else {
                    let fresh = !mem::replace(&mut l.spoken, true);
                    flood::run(plan, z, &summands, &mut l.dependency, &mut l.belief, fresh);
                }
            }
            Stage::Change => *change = winner_takes_all::change(plan, &levels[0].belief, labels),
            Stage::WinnerTakesAll => winner_takes_all::run(plan, &levels[0].belief, maps),
            Stage::RightView => winner_takes_all::right_view(plan, &levels[0].belief, maps),
            Stage::SubPixel => sub_pixel::run(plan, fine_cost, maps),
            Stage::LeftRightCheck
            | Stage::SpeckleFilter
            | Stage::Confidence
            | Stage::Fill
            | Stage::FillMedian
            | Stage::Median => maps.run(plan, pair.left(), stage),
        }
    }

    /// Stores the messages between level `z` and the next finer one, if they are but known to be 0.
    fn resolve(&mut self, z: usize) {
        if !mem::replace(&mut self.levels[z].resolved, true) {
            self.levels[z].up.fill(U::default());
            self.levels[z - 1].down.fill(U::default());
        }
    }

    fn read(&self, volume: Volume) -> Vec<u32> {
        let (rows, labels, stride) = volume_shape(&self.plan, volume);
        match volume {
            Volume::Cost(0) => gather(&self.fine_cost, labels, stride),
            Volume::Cost(z) => gather(&self.levels[z].cost, labels, stride),
            Volume::Evidence(z) => gather(&self.levels[z].evidence, labels, stride),
            Volume::Dependency(z) if self.levels[z].spoken => {
                gather(&self.levels[z].dependency, labels, stride)
            }
            Volume::Down(z) if self.levels[z + 1].resolved => gather(&self.levels[z].down, labels, stride),
            Volume::Up(z) if self.levels[z].resolved => gather(&self.levels[z].up, labels, stride),
            Volume::Dependency(_) | Volume::Down(_) | Volume::Up(_) => vec![0; rows * labels],
            Volume::Belief(z) => gather(&self.levels[z].belief, labels, stride),
        }
    }

    fn write(&mut self, volume: Volume, values: &[u32]) {
        let rows = PaddedRows::new(&self.plan, volume, values);
        let z = volume.level();
        match volume {
            Volume::Cost(0) => rows.fill(&mut self.fine_cost, |v| v as u8),
            Volume::Cost(_) => rows.fill(&mut self.levels[z].cost, |v| v as u16),
            Volume::Evidence(_) => rows.fill(&mut self.levels[z].evidence, |v| v as u8),
            Volume::Dependency(_) => {
                self.levels[z].spoken = true;
                rows.fill(&mut self.levels[z].dependency, U::of);
            }
            Volume::Down(_) => {
                self.resolve(z + 1);
                rows.fill(&mut self.levels[z].down, U::of);
            }
            Volume::Up(_) => {
                self.resolve(z);
                rows.fill(&mut self.levels[z].up, U::of);
            }
            Volume::Belief(_) => rows.fill(&mut self.levels[z].belief, U::of),
        }
    }
}

/// Runs an expression on the volumes, whatever their width.
macro_rules! on_volumes {
    ($self:ident, $volumes:ident => $body:expr) => {
        match $self.state.as_mut().expect("prepare comes before every stage") {
            State::Narrow($volumes) => $body,
            State::Wide($volumes) => $body,
        }
    };
}

impl Backend for Cpu {
    fn describe(&self) -> String {
        let threads = rayon::current_num_threads();
        format!("the CPU path, {threads} thread{}", if threads == 1 { "" } else { "s" })
    }

    fn prepare(&mut self, plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Result<()> {
        match self.state.as_mut() {
            Some(State::Narrow(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, pair, graphs),
            Some(State::Wide(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, pair, graphs),
            _ => {
                // What the last match holds goes before the next one asks for more.
                self.state = None;
                memory::check(plan.bytes(), memory::SMALLER_MATCH)?;
                self.state = Some(match plan.volume_width {
                    VolumeWidth::Narrow => State::Narrow(Volumes::new(plan, pair, graphs)?),
                    VolumeWidth::Wide => State::Wide(Volumes::new(plan, pair, graphs)?),
                });
            }
        }
        Ok(())
    }

    fn label_range(&mut self, label_ranges: &[Plane<[u16; 2]>]) -> Result<()> {
        on_volumes!(self, v => v.label_ranges = label_ranges.to_vec());
        Ok(())
    }

    fn run(&mut self, stage: Stage) -> Result<()> {
        let start = Instant::now();
        on_volumes!(self, v => v.run(stage));
        if let Some(times) = &mut self.times {
            times.push((stage, start.elapsed()));
        }
        Ok(())
    }

    fn change(&mut self) -> Result<u64> {
        self.run(Stage::Change)?;
        Ok(on_volumes!(self, v => v.change))
    }

    fn wait(&mut self) -> Result<()> {
        Ok(())
    }

    fn request_maps(&mut self) -> Result<Requested> {
        let Finest { raw, disparity, validity, confidence, .. } = on_volumes!(self, v => &v.maps);
        Ok(Requested::Here(Maps {
            disparity: disparity.clone(),
            raw: raw.clone(),
            confidence: confidence.clone(),
            validity: validity.clone(),
        }))
    }

    fn maps(&mut self, requested: Requested) -> Result<Maps> {
        match requested {
            Requested::Here(maps) => Ok(maps),
            Requested::Device(_) => unreachable!("maps of a device"),
        }
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.times = on.then(Vec::new);
        Ok(())
    }

    fn times(&mut self) -> Result<Vec<(Stage, Duration)>> {
        Ok(self.times.clone().unwrap_or_default())
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        Ok(on_volumes!(self, v => v.read(volume)))
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        on_volumes!(self, v => v.write(volume, values));
        Ok(())
    }

    fn read_map(&mut self, map: Map) -> Result<Plane<i32>> {
        Ok(on_volumes!(self, v => v.maps.read(map)))
    }

    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()> {
        on_volumes!(self, v => v.maps.write(map, values));
        Ok(())
    }

    fn poison(&mut self, byte: u8) -> Result<()> {
        on_volumes!(self, v => v.poison(byte));
        Ok(())
    }
}

/// Rows of a padded volume without their padding.
fn gather<T: Copy + Into<u32>>(data: &[T], labels: usize, stride: usize) -> Vec<u32> {
    data.chunks_exact(stride).flat_map(|row| row[..labels].iter().map(|&v| v.into())).collect()
}
