//! The CPU path: every stage, parallel over rows, with inner loops over labels.

mod features;
mod finest;
mod least_squares;
#[cfg_attr(target_arch = "wasm32", path = "pages_in_browser.rs")]
mod pages;
mod places;
mod probe;
mod units;
mod volumes;
mod windows;

use super::probe::Probe;
use super::wavefront::Wavefront;
use super::{Backend, Map, Promise, Requests, Stage, Ticket, Traffic};
use crate::error::{Purpose, Result};
use crate::front::Prepared;
use crate::image::{Image, Plane};
use crate::maps::Maps;
use crate::memory;
use crate::pause::Pause;
use crate::plan::{Plan, VolumeWidth};
pub(crate) use finest::Finest;
use std::future::ready;
use std::ops::Range;
use std::time::Duration;
use units::Units;
use volumes::{Sent, Volumes};
use web_time::Instant;

/// The CPU path.
#[derive(Default)]
pub struct Cpu {
    state: Option<State>,
    times: Option<Vec<(Stage, Duration)>>,
    requests: Requests<Maps>,
    pause: Pause,
}

/// Volumes in the width that the plan asks for.
enum State {
    Narrow(Volumes<u8>),
    Wide(Volumes<u16>),
}

macro_rules! declare {
    (
        levels { $( $(#[$_of_level:meta])* $level:ident $level_name:ident; )* }
        finest { $( $(#[$_of_finest:meta])* $finest:ident $finest_name:ident; )* }
        maps { $( $(#[$_of_map:meta])* $map:ident $map_name:ident; )* }
    ) => {
        $( mod $level_name; )*
        $( mod $finest_name; )*
        $( mod $map_name; )*

        impl<U: Units> Volumes<U> {
            fn run(&mut self, stage: Stage) {
                match stage {
                    $( Stage::$level(z) => $level_name::run(self, z), )*
                    $( Stage::$finest => $finest_name::run(self), )*
                    $( Stage::$map )|* => self.maps.run(stage, &self.plan, self.pair.left()),
                }
            }
        }

        impl Finest {
            /// Runs a stage that needs only maps; `left` is the left view of the pair that was matched.
            pub(crate) fn run(&mut self, stage: Stage, plan: &Plan, left: &Image) {
                match stage {
                    $( Stage::$map => $map_name::run(self, plan, left), )*
                    _ => unreachable!("{stage:?} needs volumes"),
                }
            }
        }
    };
}

crate::for_every_stage!(declare);

impl<U: Units> Volumes<U> {
    /// Runs rows of a stage that goes row by row.
    fn run_rows(&mut self, stage: Stage, sent: Sent, rows: Range<usize>) {
        match stage {
            Stage::Evidence(z) => evidence::rows(self, z, rows),
            Stage::Dependency(z) => dependency::rows(self, z, sent, rows),
            Stage::Resolution(z) => resolution::rows(self, z, sent, rows),
            Stage::Belief(z) => belief::rows(self, z, sent, rows),
            Stage::WinnerTakesAll => winner_takes_all::rows(self, rows),
            Stage::RightView => right_view::rows(self, rows),
            Stage::SubPixel => sub_pixel::rows(self, rows),
            _ => unreachable!("{stage:?} does not go row by row"),
        }
    }
}

/// Runs an expression on the volumes, whatever their width.
macro_rules! on_volumes {
    ($self:ident, $volumes:ident => $body:expr) => {
        match $self.state.as_mut().expect("prepare comes before every stage") {
            $crate::backend::cpu::State::Narrow($volumes) => $body,
            $crate::backend::cpu::State::Wide($volumes) => $body,
        }
    };
}

use on_volumes;

impl Backend for Cpu {
    fn describe(&self) -> String {
        let threads = rayon::current_num_threads();
        format!("the CPU path, {threads} thread{}", if threads == 1 { "" } else { "s" })
    }

    fn release(&mut self) {
        if self.state.is_some() {
            on_volumes!(self, v => v.release());
        }
    }

    fn prepare(&mut self, plan: &Plan, prepared: Prepared) -> Result<()> {
        match self.state.as_mut() {
            Some(State::Narrow(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, prepared),
            Some(State::Wide(volumes)) if plan.fits(&volumes.plan) => volumes.reset(plan, prepared),
            _ => {
                // The volumes of the last match are freed before new ones are allocated.
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

    fn run(&mut self, stage: Stage) -> Result<()> {
        let start = Instant::now();
        on_volumes!(self, v => v.run(stage));
        if let Some(times) = &mut self.times {
            times.push((stage, start.elapsed()));
        }
        Ok(())
    }

    fn keep_up(&mut self) -> Promise<'_, ()> {
        Box::pin(async {
            self.pause.now_and_then().await;
            Ok(())
        })
    }

    fn run_wavefront<'a>(
        &'a mut self,
        wavefront: &'a Wavefront,
        before: &'a mut dyn FnMut(Stage, f64) -> Result<()>,
    ) -> Promise<'a, ()> {
        Box::pin(async {
            let sent = on_volumes!(self, v => wavefront.stages().iter().map(|&stage| v.begin(stage)).collect::<Vec<_>>());
            let mut times = vec![Duration::ZERO; sent.len()];
            for (i, rows) in wavefront.parts() {
                let stage = wavefront.stages()[i];
                let height = on_volumes!(self, v => v.plan.levels[stage.level().unwrap_or(0)].height);
                before(stage, rows.len() as f64 / height as f64)?;
                let start = Instant::now();
                on_volumes!(self, v => v.run_rows(stage, sent[i], rows));
                times[i] += start.elapsed();
                self.pause.now_and_then().await;
            }
            if let Some(all) = &mut self.times {
                all.extend(wavefront.stages().iter().copied().zip(times));
            }
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
        let Finest { raw, disparity, validity, confidence, .. } = on_volumes!(self, v => &v.maps);
        let maps = Maps {
            disparity: disparity.clone(),
            raw: raw.clone(),
            confidence: confidence.clone(),
            validity: validity.clone(),
            right: None,
        };
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
