//! Reads and writes volumes and maps on a device, and measures its copy rate.

use super::rows::Rows;
use super::stages::record_transposed;
use super::words::window_words;
use super::{Gpu, State};
use crate::backend::probe::Probe;
use crate::backend::{Backend, Map, Stage};
use crate::error::{Error, Result};
use crate::graph::{LevelGraph, NO_MEMBER};
use crate::image::Plane;
use crate::plan::Plan;
use crate::stage::{Data, PaddedRows, Volume, volume_shape};
use pollster::block_on;
use std::time::Duration;
use web_time::Instant;

/// Bytes that [`Gpu::copy_rate`] copies, number of tries, and minimum time of a try, to hide overhead.
const COPIED_BYTES: u64 = 1 << 28;
const COPY_TRIES: u32 = 12;
const LONG_COPY: Duration = Duration::from_millis(100);

impl Probe for Gpu {
    fn read(&mut self, volume: Volume) -> Result<Vec<u32>> {
        if self.state().messages.lacks(volume) {
            let (rows, labels, _) = volume_shape(&self.state().plan, volume);
            return Ok(vec![0; rows * labels]);
        }
        let (buffer, pitch, per_word) = self.volume(volume);
        let words = block_on(self.words(&buffer))?;
        let plan = &self.state().plan;
        let (rows, labels, _) = volume_shape(plan, volume);
        let (place, bits) = (word_places(plan, volume, per_word), 32 / per_word);
        let lines = rows / plan.levels[volume.level()].height;
        let mut values = Vec::with_capacity(rows * labels);
        for line in words.chunks_exact(pitch) {
            for (i, label) in (0..lines).flat_map(|i| (0..labels).map(move |label| (i, label))) {
                let word = line[place(i, label)] >> (bits * (label % per_word));
                values.push(word & (u32::MAX >> (32 - bits)));
            }
        }
        Ok(values)
    }

    fn write(&mut self, volume: Volume, values: &[u32]) -> Result<()> {
        self.submit()?;
        let State { plan, buffers, messages, .. } = self.state.as_mut().expect("a match to write to");
        for unsent in messages.write(volume) {
            let words = Data::Volume(unsent).array(plan).words * plan.levels[unsent.level()].height;
            buffers.volume(plan, unsent).write(&mut self.device, &vec![0; words])?;
        }
        let (buffer, pitch, per_word) = self.volume(volume);
        let plan = &self.state().plan;
        let height = plan.levels[volume.level()].height;
        let rows = PaddedRows::new(plan, volume, values);
        let per_line = volume_shape(plan, volume).0 / height;
        let (place, bits) = (word_places(plan, volume, per_word), 32 / per_word);
        let mut words = vec![0u32; pitch * height];
        for (i, row) in rows.iter().enumerate() {
            let line = &mut words[i / per_line * pitch..];
            for (label, value) in row.into_iter().enumerate() {
                line[place(i % per_line, label)] |= value << (bits * (label % per_word));
            }
        }
        buffer.write(&mut self.device, &words)
    }

    fn windows(&mut self, level: usize) -> Result<Plane<[u16; 2]>> {
        let (runs, rows) = self.state().plan.levels[level].windows();
        let windows = self.state().buffers.rows(&self.state().plan, Data::Windows(level)).clone();
        let words = block_on(self.words(&windows))?;
        let windows = words[..runs * rows].iter().map(|&word| [word as u16, (word >> 16) as u16]).collect();
        Ok(Plane::new(runs, rows, windows))
    }

    fn set_windows(&mut self, level: usize, windows: &Plane<[u16; 2]>) -> Result<()> {
        self.submit()?;
        let [(buffer, place)] =
            &self.state().buffers.rows(&self.state().plan, Data::Windows(level)).own()[..]
        else {
            unreachable!("one row is in one part")
        };
        self.device.write_at(buffer, place.start, bytemuck::cast_slice(&window_words(windows)))
    }

    fn change(&mut self) -> Result<u64> {
        Ok(block_on(self.convergence())?.sum())
    }

    fn graph(&mut self, level: usize) -> Result<LevelGraph> {
        let State { plan, buffers, .. } = self.state();
        let members = buffers.rows(plan, Data::Members(level)).clone();
        let pitch = buffers.levels[level].member_pitch as usize;
        let words = block_on(self.words(&members))?;
        let plan = &self.state().plan;
        let (neighbours, l) = (plan.neighbours, &plan.levels[level]);
        let code = |x: usize, y: usize, i: usize| {
            (words[y * pitch + x * neighbours.div_ceil(4) + i / 4] >> (8 * (i % 4))) as u8
        };
        let pixels = (0..l.height).flat_map(|y| (0..l.width).map(move |x| (x, y)));
        let codes = pixels.flat_map(|(x, y)| (0..neighbours).map(move |i| (x, y, i)));
        let codes = codes.map(|(x, y, i)| code(x, y, i)).collect();
        Ok(LevelGraph::new(l.width, l.height, neighbours, codes))
    }

    fn set_graph(&mut self, level: usize, graph: &LevelGraph) -> Result<()> {
        self.submit()?;
        let state = self.state.take().expect("prepare comes before every stage");
        let neighbours = state.plan.neighbours;
        let pitch = state.buffers.levels[level].member_pitch as usize;
        let mut words = vec![u32::MAX; pitch * graph.height()];
        for (factor, codes) in graph.codes().chunks_exact(neighbours.max(1)).enumerate() {
            let (x, y) = (factor % graph.width(), factor / graph.width());
            for (i, &code) in codes.iter().enumerate() {
                let word = &mut words[y * pitch + x * neighbours.div_ceil(4) + i / 4];
                *word ^= u32::from(code ^ NO_MEMBER) << (8 * (i % 4));
            }
        }
        state.buffers.rows(&state.plan, Data::Members(level)).write(&mut self.device, &words)?;
        let commands = self.recorded_at(level, &state.plan, &state.buffers, 0.0, None, |recorder| {
            record_transposed(recorder)
        })?;
        self.state = Some(state);
        self.record(&commands)
    }

    fn write_map(&mut self, map: Map, values: &Plane<i32>) -> Result<()> {
        let (rows, words, word, bit, mask) = self.place_of(map);
        let mut data = block_on(self.words(&rows))?;
        let (width, height, pitch) = self.map_shape(map);
        assert_eq!(values.size(), (width, height), "a map of the size of the images");
        for y in 0..height {
            for x in 0..width {
                let old = &mut data[words * (y * pitch + x) + word];
                *old = *old & !(mask << bit) | (values[(x, y)].cast_unsigned() & mask) << bit;
            }
        }
        rows.write(&mut self.device, &data)
    }

    fn poison(&mut self, byte: u8) -> Result<()> {
        self.submit()?;
        let State { plan, messages, .. } = self.state.as_mut().expect("a match to poison");
        for stage in Stage::all(plan) {
            messages.send(stage);
        }
        let all = self.state().buffers.written().to_vec();
        for buffer in all {
            self.device.write(&buffer, &vec![byte; buffer.size() as usize])?;
        }
        Ok(())
    }
}

impl Gpu {
    /// The rate at which the device copies between two large buffers: bytes read and written per second.
    ///
    /// # Errors
    /// [`Error::Memory`] if two such buffers do not fit, [`Error::Device`] if the device fails.
    pub fn copy_rate(&mut self) -> Result<f64> {
        let size = COPIED_BYTES.min(self.device.max_buffer) & !3;
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let (from, to) = (self.device.buffer("copy", size, usage)?, self.device.buffer("copy", size, usage)?);
        let mut time = |copies: u64| {
            let start = Instant::now();
            for _ in 0..copies {
                self.encoder()?.copy_buffer_to_buffer(&from, 0, &to, 0, size);
            }
            block_on(self.wait())?;
            Ok::<_, Error>(start.elapsed())
        };
        // Memory is allocated on first access.
        time(1)?;
        let (mut best, mut copies) = (0.0, 1);
        for _ in 0..COPY_TRIES {
            let time = time(copies)?;
            best = f64::max(best, (2 * copies * size) as f64 / time.as_secs_f64());
            if time < LONG_COPY {
                copies *= 2;
            }
        }
        Ok(best)
    }

    /// The values of a map, whose words may contain other maps too.
    pub(super) async fn map_values(&mut self, map: Map) -> Result<Plane<i32>> {
        let (rows, words, word, bit, mask) = self.place_of(map);
        let data = self.words(&rows).await?;
        let (width, height, pitch) = self.map_shape(map);
        let value = |x: usize, y: usize| (data[words * (y * pitch + x) + word] >> bit & mask).cast_signed();
        Ok(Plane::from_fn(width, height, value))
    }

    /// The location of a volume: its rows, words per row and values per word.
    fn volume(&self, volume: Volume) -> (Rows, usize, usize) {
        let State { plan, buffers, .. } = self.state();
        let array = Data::Volume(volume).array(plan);
        let bytes = volume.bytes(plan);
        (buffers.volume(plan, volume).clone(), array.words, 4 / bytes)
    }

    /// The location of a map: its rows, words per pixel, the word, the lowest bit and the mask.
    fn place_of(&self, map: Map) -> (Rows, usize, usize, u32, u32) {
        let State { plan, buffers, .. } = self.state();
        let (word, bit, mask) = match map {
            Map::Label | Map::RightLabel => (0, 0, 0xffff),
            Map::Best | Map::RightBest => (0, 16, 0xffff),
            Map::RunnerUp => (1, 0, 0xffff),
            Map::Raw | Map::Disparity | Map::Anchor | Map::FullRaw | Map::FullDisparity => (0, 0, u32::MAX),
            Map::Validity | Map::FullValidity => (0, 0, 0xff),
            Map::Confidence | Map::FullConfidence => (0, 8, 0xff),
        };
        (buffers.map(plan, map).clone(), map.words(), word, bit, mask)
    }
}

/// Index in a row of `volume` of the word with a label of its line \[x\]\[slot\]. Shaders store the first
/// four labels of all pixels, then the next four, and so on, slot by slot.
fn word_places(plan: &Plan, volume: Volume, per_word: usize) -> impl Fn(usize, usize) -> usize + use<> {
    let level = &plan.levels[volume.level()];
    let slots = volume_shape(plan, volume).0 / level.pixels();
    let (width, quads) = (level.width, level.stride / 4);
    move |line, label| {
        let quad = (line % slots * quads + label / 4) * width + line / slots;
        quad * (4 / per_word) + label % 4 / per_word
    }
}
