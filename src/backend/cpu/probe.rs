//! Reads and writes volumes and maps of the CPU path, and measures its copy rate.

use super::units::Units;
use super::volumes::Volumes;
use super::{Cpu, on_volumes};
use crate::backend::Map;
use crate::backend::probe::Probe;
use crate::backend::volume::{PaddedRows, Volume, volume_shape};
use crate::error::Result;
use crate::image::Plane;
use rayon::prelude::*;
use std::hint::black_box;
use std::mem;
use std::time::Instant;

/// Bytes that [`Cpu::copy_rate`] copies, and its number of tries.
const COPIED_BYTES: usize = 1 << 28;
const COPY_TRIES: usize = 8;

impl Cpu {
    /// The rate at which the threads of the current pool copy between two buffers larger than caches: bytes
    /// read and written per second, the best of a few tries.
    #[must_use]
    pub fn copy_rate() -> f64 {
        let from = vec![1u8; COPIED_BYTES];
        let mut to = vec![0u8; COPIED_BYTES];
        // One piece per thread: copies of long runs bypass the caches.
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

impl Probe for Cpu {
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        Ok(on_volumes!(self, v => v.read(volume)))
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        on_volumes!(self, v => v.write(volume, values));
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
        for level in &mut self.levels {
            level.cost.fill(wide);
            level.evidence.fill(byte);
            (level.dependency_sent, level.resolution_sent) = (true, true);
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

    /// Makes the messages between level `z` and the next finer one count as stored: where none have been sent
    /// yet, they become 0.
    fn store_resolution(&mut self, z: usize) {
        if !mem::replace(&mut self.levels[z].resolution_sent, true) {
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
            Volume::Dependency(z) if self.levels[z].dependency_sent => {
                gather(&self.levels[z].dependency, labels, stride)
            }
            Volume::Down(z) if self.levels[z + 1].resolution_sent => {
                gather(&self.levels[z].down, labels, stride)
            }
            Volume::Up(z) if self.levels[z].resolution_sent => gather(&self.levels[z].up, labels, stride),
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
                self.levels[z].dependency_sent = true;
                rows.fill(&mut self.levels[z].dependency, U::of);
            }
            Volume::Down(_) => {
                self.store_resolution(z + 1);
                rows.fill(&mut self.levels[z].down, U::of);
            }
            Volume::Up(_) => {
                self.store_resolution(z);
                rows.fill(&mut self.levels[z].up, U::of);
            }
            Volume::Belief(_) => rows.fill(&mut self.levels[z].belief, U::of),
        }
    }
}

/// The rows of a padded volume, without their padding.
fn gather<T: Copy + Into<u32>>(data: &[T], labels: usize, stride: usize) -> Vec<u32> {
    data.chunks_exact(stride).flat_map(|row| row[..labels].iter().map(|&v| v.into())).collect()
}
