//! The CPU path: every stage, parallel over rows, with inner loops over labels.

mod colours;
mod features;
mod least_squares;
#[cfg_attr(target_arch = "wasm32", path = "pages_in_browser.rs")]
mod pages;
mod places;
mod probe;
mod stages;
mod units;
mod volumes;
mod windows;

use super::probe::Probe;
use super::{Backend, Map, Promise, Requests, Stage, Ticket, Traffic};
use crate::error::{Purpose, Result};
use crate::front::Prepared;
use crate::graph::LevelGraph;
use crate::image::{Pair, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::pause::Pause;
use crate::plan::{Plan, VolumeWidth};
use crate::program::{Program, RowBand, Run, sharing, together};
use crate::stage::{Data, MapSet};
use crate::threads::prelude::current_num_threads;
use std::future::ready;
use std::time::Duration;
use volumes::Volumes;
use web_time::Instant;

/// The CPU path.
#[derive(Default)]
pub struct Cpu {
    state: Option<State>,
    times: Option<Vec<(Stage, Duration)>>,
    requests: Requests<Maps>,
    pause: Pause,
}

/// Volumes in the width of the plan.
enum State {
    Narrow(Volumes<u8>),
    Wide(Volumes<u16>),
}

/// Runs an expression on the volumes of either width.
macro_rules! on_volumes {
    ($self:ident, $volumes:ident => $body:expr) => {
        match $self.state.as_mut().expect("prepare comes before every stage") {
            $crate::backend::cpu::State::Narrow($volumes) => $body,
            $crate::backend::cpu::State::Wide($volumes) => $body,
        }
    };
}

use on_volumes;

impl Cpu {
    /// The CPU path on the maps of a match of `pair`, for map stages only.
    pub(crate) fn of_maps(plan: &Plan, pair: Pair, maps: MapSet) -> Self {
        Self { state: Some(State::Narrow(Volumes::of_maps(plan, pair, maps))), ..Self::default() }
    }

    /// The pair and its maps.
    pub(crate) fn into_maps(self) -> (Pair, MapSet) {
        match self.state.expect("maps of a match") {
            State::Narrow(volumes) => (volumes.pair, volumes.maps),
            State::Wide(volumes) => (volumes.pair, volumes.maps),
        }
    }
}

impl Backend for Cpu {
    fn describe(&self) -> String {
        let threads = current_num_threads();
        format!("the CPU path, {threads} thread{}", if threads == 1 { "" } else { "s" })
    }

    fn release(&mut self) {
        if self.state.is_some() {
            on_volumes!(self, v => v.release());
        }
    }

    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()> {
        prepared.pair.compute();
        match self.state.as_mut() {
            Some(State::Narrow(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, prepared),
            Some(State::Wide(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, prepared),
            _ => {
                // Free the volumes of the last match before new ones are allocated.
                self.state = None;
                memory::check(plan.bytes(), Purpose::Match)?;
                self.state = Some(match plan.volume_width {
                    VolumeWidth::Narrow => State::Narrow(Volumes::new(plan, prepared)?),
                    VolumeWidth::Wide => State::Wide(Volumes::new(plan, prepared)?),
                });
            }
        }
        Ok(())
    }

    fn fit(&mut self, program: Program) -> Program {
        program.each_frame(|plan, steps| {
            let steps = together::pass(plan, steps);
            *plan = plan.on_host();
            sharing::pass(plan, steps)
        })
    }

    fn free(&mut self, data: Data) {
        if let Data::Members(z) = data {
            on_volumes!(self, v => v.levels[z].graph = LevelGraph::default());
        }
    }

    fn perform(&mut self, run: &Run) -> Result<()> {
        for stage in run.stages() {
            let start = Instant::now();
            on_volumes!(self, v => match &run.band {
                None => v.run(stage),
                Some(RowBand { rows, sent }) => {
                    v.begin(stage);
                    v.run_rows(stage, *sent, rows.clone());
                }
            });
            let begins = run.band.as_ref().is_none_or(|band| band.rows.start == 0);
            let Some(times) = &mut self.times else { continue };
            match times.iter_mut().rev().find(|time| time.0 == stage && !begins) {
                Some(time) => time.1 += start.elapsed(),
                None => times.push((stage, start.elapsed())),
            }
        }
        Ok(())
    }

    fn keep_up(&mut self) -> Promise<'_, ()> {
        Box::pin(async {
            self.pause.now_and_then().await;
            Ok(())
        })
    }

    fn settled(&mut self, _: bool) -> Promise<'_, bool> {
        Box::pin(ready(Ok(on_volumes!(self, v => v.settled))))
    }

    fn idle_iterations(&mut self) -> Promise<'_, u32> {
        Box::pin(ready(Ok(0)))
    }

    fn wait(&mut self) -> Promise<'_, ()> {
        Box::pin(ready(Ok(())))
    }

    fn map(&mut self, map: Map) -> Promise<'_, Plane<i32>> {
        Box::pin(ready(Ok(on_volumes!(self, v => v.maps.read(map)))))
    }

    fn request_maps(&mut self) -> Result<Ticket> {
        let maps = on_volumes!(self, v => v.maps.found(v.plan.full.is_some()));
        Ok(self.requests.add(maps))
    }

    fn maps(&mut self, ticket: Ticket) -> Promise<'_, (Maps, u32)> {
        Box::pin(ready(Ok((self.requests.take(&ticket), 0))))
    }

    fn keep_time(&mut self, on: bool) -> Result<()> {
        self.times = on.then(Vec::new);
        Ok(())
    }

    fn times(&mut self) -> Promise<'_, Vec<(Stage, Duration)>> {
        Box::pin(ready(Ok(self.times.clone().unwrap_or_default())))
    }

    fn cells(&self) -> Vec<u64> {
        match self.state.as_ref().expect("prepare comes before every stage") {
            State::Narrow(v) => v.levels.iter().map(|level| level.windows.cells()).collect(),
            State::Wide(v) => v.levels.iter().map(|level| level.windows.cells()).collect(),
        }
    }

    fn traffic(&self) -> Traffic {
        Traffic::default()
    }

    fn probe(&mut self) -> &mut dyn Probe {
        self
    }
}
