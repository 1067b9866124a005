//! The CPU path: every stage, parallel over rows, its inner loops over labels.

mod belief;
mod cost;
mod dependency;
mod estimate;
mod evidence;
mod message;
mod pyramid;
mod resolution;

use super::{Backend, Estimate, PaddedRows, Volume, volume_shape};
use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::Pair;
use crate::memory;
use crate::plan::{MessageWidth, Plan};
use message::Message;

/// The CPU path.
#[derive(Default)]
pub struct Cpu {
    state: Option<State>,
}

/// Volumes in the message width that the plan asks for.
enum State {
    Narrow(Volumes<u8>),
    Wide(Volumes<u16>),
}

/// All volumes of a match.
struct Volumes<M> {
    plan: Plan,
    pair: Pair,
    /// Cost of level 0; coarser ones are in `levels`.
    fine_cost: Vec<u8>,
    levels: Vec<Level<M>>,
    /// Label map of the last call of `change`.
    labels: Vec<u16>,
}

/// Volumes of one level, each \[y\]\[x\]\[slot\]\[label\] with padded labels.
struct Level<M> {
    graph: LevelGraph,
    /// In 1/256 cost units; empty at level 0.
    cost: Vec<u16>,
    evidence: Vec<u8>,
    dependency: Vec<M>,
    /// Empty at the coarsest level.
    down: Vec<M>,
    /// Empty at level 0.
    up: Vec<M>,
    belief: Vec<u16>,
}

impl<M: Message> Volumes<M> {
    fn new(plan: &Plan, pair: &Pair, graphs: Vec<LevelGraph>) -> Self {
        let last = plan.levels.len() - 1;
        let levels = graphs
            .into_iter()
            .enumerate()
            .map(|(z, graph)| {
                let level = &plan.levels[z];
                let cells = level.pixels() * level.stride;
                Level {
                    cost: vec![0; if z == 0 { 0 } else { cells }],
                    evidence: vec![0; cells],
                    dependency: vec![M::default(); cells * graph.slots()],
                    down: vec![M::default(); if z == last { 0 } else { cells }],
                    up: vec![M::default(); if z == 0 { 0 } else { cells }],
                    belief: vec![0; cells],
                    graph,
                }
            })
            .collect();
        let fine = &plan.levels[0];
        Self {
            plan: plan.clone(),
            pair: pair.clone(),
            fine_cost: vec![0; fine.pixels() * fine.stride],
            levels,
            labels: vec![0; fine.pixels()],
        }
    }

    fn read(&self, volume: Volume) -> Vec<u32> {
        let (_, labels, stride) = volume_shape(&self.plan, volume);
        match volume {
            Volume::Cost(0) => gather(&self.fine_cost, labels, stride),
            Volume::Cost(z) => gather(&self.levels[z].cost, labels, stride),
            Volume::Evidence(z) => gather(&self.levels[z].evidence, labels, stride),
            Volume::Dependency(z) => gather(&self.levels[z].dependency, labels, stride),
            Volume::Down(z) => gather(&self.levels[z].down, labels, stride),
            Volume::Up(z) => gather(&self.levels[z].up, labels, stride),
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
            Volume::Dependency(_) => rows.fill(&mut self.levels[z].dependency, M::from_u32),
            Volume::Down(_) => rows.fill(&mut self.levels[z].down, M::from_u32),
            Volume::Up(_) => rows.fill(&mut self.levels[z].up, M::from_u32),
            Volume::Belief(_) => rows.fill(&mut self.levels[z].belief, |v| v as u16),
        }
    }
}

/// Runs an expression on the volumes, whatever their message width.
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
        // What the last match holds goes before the next one asks for more.
        self.state = None;
        memory::check(plan)?;
        self.state = Some(match plan.message_width {
            MessageWidth::Narrow => State::Narrow(Volumes::new(plan, pair, graphs)),
            MessageWidth::Wide => State::Wide(Volumes::new(plan, pair, graphs)),
        });
        Ok(())
    }

    fn cost(&mut self) -> Result<()> {
        on_volumes!(self, v => cost::run(&v.plan, &v.pair, &mut v.fine_cost));
        Ok(())
    }

    fn pyramid(&mut self, level: usize) -> Result<()> {
        on_volumes!(self, v => {
            let (finer, coarser) = v.levels.split_at_mut(level);
            let out = &mut coarser[0].cost;
            if level == 1 {
                pyramid::run(&v.plan, level, &v.fine_cost, out);
            } else {
                pyramid::run(&v.plan, level, &finer[level - 1].cost, out);
            }
        });
        Ok(())
    }

    fn evidence(&mut self, level: usize) -> Result<()> {
        on_volumes!(self, v => {
            let l = &mut v.levels[level];
            if level == 0 {
                evidence::run(&v.plan.levels[level], &v.fine_cost, &mut l.evidence, &mut l.belief);
            } else {
                evidence::run(&v.plan.levels[level], &l.cost, &mut l.evidence, &mut l.belief);
            }
        });
        Ok(())
    }

    fn dependency(&mut self, level: usize) -> Result<()> {
        on_volumes!(self, v => {
            let l = &mut v.levels[level];
            dependency::run(&v.plan, level, &l.graph, &l.belief, &mut l.dependency);
        });
        Ok(())
    }

    fn resolution(&mut self, level: usize) -> Result<()> {
        on_volumes!(self, v => {
            let (finer, coarser) = v.levels.split_at_mut(level);
            let (fine, coarse) = (&mut finer[level - 1], &mut coarser[0]);
            resolution::run(&v.plan, level, &fine.belief, &coarse.belief, &mut fine.down, &mut coarse.up);
        });
        Ok(())
    }

    fn belief(&mut self, level: usize) -> Result<()> {
        on_volumes!(self, v => {
            let stride = v.plan.levels[level].stride;
            let l = &mut v.levels[level];
            belief::run(stride, &l.graph, &l.evidence, &l.dependency, &l.down, &l.up, &mut l.belief);
        });
        Ok(())
    }

    fn change(&mut self) -> Result<u64> {
        Ok(on_volumes!(self, v => estimate::change(&v.plan, &v.levels[0].belief, &mut v.labels)))
    }

    fn estimate(&mut self) -> Result<Estimate> {
        Ok(on_volumes!(self, v => estimate::run(&v.plan, &v.fine_cost, &v.levels[0].belief)))
    }

    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        Ok(on_volumes!(self, v => v.read(volume)))
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        on_volumes!(self, v => v.write(volume, values));
        Ok(())
    }
}

/// Rows of a padded volume without their padding.
fn gather<T: Copy + Into<u32>>(data: &[T], labels: usize, stride: usize) -> Vec<u32> {
    data.chunks_exact(stride).flat_map(|row| row[..labels].iter().map(|&v| v.into())).collect()
}
