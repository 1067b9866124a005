//! Reads and writes volumes and maps of the CPU path, and measures its copy rate.

use super::units::Units;
use super::volumes::Volumes;
use super::windows::{Window, Windows};
use super::{Cpu, on_volumes};
use crate::backend::probe::Probe;
use crate::backend::{Map, Stage};
use crate::error::Result;
use crate::graph::LevelGraph;
use crate::image::Plane;
use crate::plan::LevelPlan;
use crate::stage::{PaddedRows, Volume, volume_shape};
use crate::threads::prelude::*;
use std::hint::black_box;
use web_time::Instant;

/// Bytes that [`Cpu::copy_rate`] copies, and number of tries.
const COPIED_BYTES: usize = 1 << 28;
const COPY_TRIES: usize = 8;

impl Cpu {
    /// The rate at which the threads of the current pool copy between buffers larger than caches: bytes read
    /// and written per second, the best of a few tries.
    #[must_use]
    pub fn copy_rate() -> f64 {
        let from = vec![1u8; COPIED_BYTES];
        let mut to = vec![0u8; COPIED_BYTES];
        // One piece per thread, because long copies bypass the caches.
        let piece = COPIED_BYTES.div_ceil(current_num_threads());
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

impl Probe for Cpu {
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        Ok(on_volumes!(self, v => v.read(volume)))
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        on_volumes!(self, v => v.write(volume, values));
        Ok(())
    }

    fn windows(&mut self, level: usize) -> Result<Plane<[u16; 2]>> {
        Ok(on_volumes!(self, v => v.levels[level].windows.to_plane()))
    }

    fn set_windows(&mut self, level: usize, windows: &Plane<[u16; 2]>) -> Result<()> {
        on_volumes!(self, v => {
            let (plan, held) = (&v.plan.levels[level], v.plan.rows_held(level));
            v.levels[level].windows = Windows::new(plan, held, windows);
        });
        Ok(())
    }

    fn change(&mut self) -> Result<u64> {
        Ok(on_volumes!(self, v => v.change.unwrap_or(0)))
    }

    fn graph(&mut self, level: usize) -> Result<LevelGraph> {
        Ok(on_volumes!(self, v => v.levels[level].graph.clone()))
    }

    fn set_graph(&mut self, level: usize, graph: &LevelGraph) -> Result<()> {
        on_volumes!(self, v => v.levels[level].graph = graph.clone());
        Ok(())
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

impl<U: Units> Volumes<U> {
    fn poison(&mut self, byte: u8) {
        let wide = u16::from_ne_bytes([byte; 2]);
        self.fine_cost.fill(byte);
        self.labels.fill(wide);
        for stage in Stage::all(&self.plan) {
            self.messages.send(stage);
        }
        for level in &mut self.levels {
            level.cost.fill(wide);
            level.evidence.fill(byte);
            level.belief.fill(U::of(u32::from(wide) & Into::<u32>::into(U::MOST)));
            for messages in [&mut level.dependency, &mut level.down, &mut level.up] {
                messages.fill(U::of(u32::from(wide) & Into::<u32>::into(U::MOST)));
            }
        }
        for map in Map::all(&self.plan) {
            let (width, height) = map.size(&self.plan);
            self.maps.write(map, &Plane::filled(width, height, i32::from_ne_bytes([byte; 4])));
        }
    }

    fn read(&self, volume: Volume) -> Vec<u32> {
        let (rows, labels, stride) = volume_shape(&self.plan, volume);
        let z = volume.level();
        let (l, [dependency, resolution]) =
            (&self.levels[z], [self.plan.dependency, self.plan.resolution].map(|cut| u32::from(cut.tau)));
        match volume {
            Volume::Cost(0) => gather(&self.fine_cost, labels, stride),
            Volume::Cost(_) => gather(&l.cost, labels, stride),
            Volume::Evidence(_) => self.gather_windows(z, &l.evidence, 1, u8::MAX.into()),
            _ if self.messages.lacks(volume) => vec![0; rows * labels],
            Volume::Dependency(_) => self.gather_windows(z, &l.dependency, self.plan.slots(), dependency),
            Volume::Down(_) => self.gather_windows(z, &l.down, 1, resolution),
            Volume::Up(_) => self.gather_windows(z, &l.up, 1, resolution),
            Volume::Belief(_) => self.gather_windows(z, &l.belief, 1, U::MOST.into()),
        }
    }

    /// The rows of a volume of level `z`, with `outside` at labels that a pixel does not have.
    fn gather_windows<T: Copy + Into<u32>>(
        &self,
        z: usize,
        data: &[T],
        slots: usize,
        outside: u32,
    ) -> Vec<u32> {
        let (l, windows) = (&self.plan.levels[z], &self.levels[z].windows);
        let mut out = vec![outside; l.pixels() * slots * l.labels];
        let mut rows = out.chunks_exact_mut(l.labels);
        each_row(l, windows, slots, |window, at| {
            let out = rows.next().expect("a row a slot");
            for (out, &value) in out[windows.range(window)].iter_mut().zip(&data[at..]) {
                *out = value.into();
            }
        });
        out
    }

    fn write(&mut self, volume: Volume, values: &[u32]) {
        let z = volume.level();
        for unsent in self.messages.write(volume) {
            let level = &mut self.levels[unsent.level()];
            let messages = if matches!(unsent, Volume::Up(_)) { &mut level.up } else { &mut level.down };
            messages.fill(U::default());
        }
        let padded = || PaddedRows::new(&self.plan, volume, values);
        let (plan, l) = (&self.plan.levels[z], &mut self.levels[z]);
        match volume {
            Volume::Cost(0) => padded().fill(&mut self.fine_cost, |v| v as u8),
            Volume::Cost(_) => padded().fill(&mut l.cost, |v| v as u16),
            Volume::Evidence(_) => {
                scatter(plan, &l.windows, (1, u8::MAX), values, |v| v as u8, &mut l.evidence);
            }
            Volume::Belief(_) => scatter(plan, &l.windows, (1, U::MOST), values, U::of, &mut l.belief),
            Volume::Dependency(_) | Volume::Down(_) | Volume::Up(_) => {
                let (slots, messages) = match volume {
                    Volume::Dependency(_) => (self.plan.slots(), &mut l.dependency),
                    Volume::Down(_) => (1, &mut l.down),
                    _ => (1, &mut l.up),
                };
                scatter(plan, &l.windows, (slots, U::default()), values, U::of, messages);
            }
        }
    }
}

/// Calls `with` for every slot of every pixel, with the pixel's window and the slot's first index.
fn each_row(level: &LevelPlan, windows: &Windows, slots: usize, mut with: impl FnMut(Window, usize)) {
    for (x, y) in (0..level.height).flat_map(|y| (0..level.width).map(move |x| (x, y))) {
        let window = windows.row(y)[x];
        let start = slots * (windows.start(y) + window.start());
        (0..slots).for_each(|slot| with(window, start + slot * window.stride()));
    }
}

/// Writes the rows `values` of a level, `slots` per pixel, to a volume, followed by `padding`.
fn scatter<T: Copy>(
    level: &LevelPlan,
    windows: &Windows,
    (slots, padding): (usize, T),
    values: &[u32],
    convert: impl Fn(u32) -> T,
    data: &mut [T],
) {
    let mut rows = values.chunks_exact(level.labels);
    each_row(level, windows, slots, |window, at| {
        let row = &rows.next().expect("a row a slot")[windows.range(window)];
        let (cells, after) = data[at..][..window.stride()].split_at_mut(row.len());
        cells.iter_mut().zip(row).for_each(|(cell, &value)| *cell = convert(value));
        after.fill(padding);
    });
}

/// The rows of a padded volume, without their padding.
fn gather<T: Copy + Into<u32>>(data: &[T], labels: usize, stride: usize) -> Vec<u32> {
    data.chunks_exact(stride).flat_map(|row| row[..labels].iter().map(|&v| v.into())).collect()
}
