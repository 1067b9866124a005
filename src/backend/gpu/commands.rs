//! Records stages as dispatches, in bands of rows if a buffer exceeds the largest binding of the device.

use super::buffers::{Buffers, Exchanged};
use super::device::{Device, ONE_ROW};
use super::kernel::{Bound, Kernel, MAX_LOOP_ITERATIONS};
use super::rows::{Binding, Copy, Rows, with_halo};
use super::shader::{Shader, WORKGROUP, binding_number};
use super::uniform::{self, Band, Header, Layout, LevelParams};
use crate::error::{DeviceError, Result};
use crate::plan::{LevelPlan, Plan};
use crate::program::Sent;
use crate::stage::{Data, Extent, Map, Volume};
use bytemuck::bytes_of;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// The commands of a stage, in order.
pub(super) enum Command {
    Dispatch(Dispatch),
    Copy(Copy),
    /// A map and its successor change places.
    Exchange(Map),
}

pub(super) struct Dispatch {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) groups: Groups,
    /// Approximate time on one thread of a processor, in ns. Until its run is [complete](Recorder::complete), only
    /// its share counts: an upper bound of the loop iterations of all invocations.
    pub(super) work: u64,
}

/// Workgroups of a dispatch.
pub(super) enum Groups {
    /// (x, y).
    Fixed(u32, u32),
    /// Index of the counts in [`Buffers::groups`], which are zeroed once the label map has settled.
    UntilSettled(usize),
}

/// A compiled kernel.
#[derive(Clone)]
pub(super) struct Pipeline {
    inner: wgpu::ComputePipeline,
    /// The binding number of each of its names.
    numbers: Vec<u32>,
}

impl Pipeline {
    /// Compiles `kernel`, on any thread.
    pub(super) fn compiled(device: &wgpu::Device, kernel: &Kernel) -> Self {
        let Kernel { shader, bound, .. } = kernel;
        let source = shader.source();
        let number =
            |bound: &Bound| binding_number(&source, bound.name).expect("the shader has what is bound");
        let numbers = bound.iter().map(number).collect();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(shader.stage),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let inner = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(shader.stage),
            layout: None,
            module: &module,
            entry_point: Some(shader.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        Self { inner, numbers }
    }
}

/// Compiled kernels.
pub(super) type Pipelines = HashMap<Shader, Pipeline>;

/// The part of a dispatch at one level.
struct Section {
    level: LevelParams,
    rows: Range<u32>,
    /// (invocations per row, rows).
    size: (u32, u32),
    /// Offsets of volumes and dependency messages in the bindings, in quads.
    at: (u32, u32),
    /// The bytes of the stage's own uniform.
    own: Vec<u8>,
}

/// Records the commands of a stage at a level. Only its entry points are generic over kernels, so that the rest is compiled once.
pub(super) struct Recorder<'a> {
    pub(super) device: &'a mut Device,
    pub(super) pipelines: &'a mut Pipelines,
    pub(super) plan: &'a Plan,
    pub(super) buffers: &'a Buffers,
    /// The maps that are in the memory of their successors after the commands so far.
    pub(super) exchanged: Exchanged,
    pub(super) level: usize,
    /// The rows of the level to record; `None` for all.
    pub(super) only: Option<Range<u32>>,
    /// The messages that exist at each level from this one on; all if empty.
    pub(super) sent: Vec<Sent>,
    /// The rows for bindings with the prefix `source_`; `None` for the rows of the dispatch.
    pub(super) source: Option<Range<u32>>,
    /// Collects the workgroup counts of dispatches that end once the label map has settled.
    pub(super) endings: Option<&'a mut Vec<[u32; 3]>>,
    pub(super) commands: Vec<Command>,
}

impl<'a> Recorder<'a> {
    /// The array of `data`.
    pub(super) fn array(&self, data: Data) -> &'a Rows {
        self.buffers.rows_while(self.plan, data, self.exchanged)
    }

    /// The messages that exist at level `z` of the run.
    pub(super) fn sent(&self, z: usize) -> Sent {
        let sent = self.sent.get(z - self.level).copied();
        sent.unwrap_or_else(|| Sent::all(z, self.plan.levels.len()))
    }

    /// The parameters of the level for shaders.
    pub(super) fn params(&self) -> LevelParams {
        self.buffers.levels[self.level]
    }

    /// The level that `kernel` runs at.
    fn level_of(&self, kernel: &Kernel) -> usize {
        self.level + usize::from(kernel.coarser)
    }

    /// The rows that `kernel` runs over.
    fn extent_of(&self, kernel: &Kernel) -> Extent {
        kernel.extent.unwrap_or(Extent::Level(self.level_of(kernel)))
    }

    /// Dispatches `kernel` for the rows of the level, with `threads` invocations per row and one dispatch per band.
    pub(super) fn rows<U: Layout>(&mut self, kernel: &Kernel<U>, own: &U, threads: u32) -> Result<()> {
        self.each_band(&kernel.any(), bytes_of(own), &|height| (threads, height))
    }

    /// Like `rows`, with one invocation per row.
    pub(super) fn one_a_row<U: Layout>(&mut self, kernel: &Kernel<U>, own: &U) -> Result<()> {
        self.each_band(&kernel.any(), bytes_of(own), &|height| (height, 1))
    }

    fn each_band(&mut self, kernel: &Kernel, own: &[u8], size: &dyn Fn(u32) -> (u32, u32)) -> Result<()> {
        for rows in self.bands(&self.cuts(self.level_of(kernel)), &[(kernel, 0)])? {
            let size = size(rows.end - rows.start);
            self.band(kernel, own.to_vec(), rows, size)?;
        }
        Ok(())
    }

    /// The array for a binding of `kernel`, and its rows if the kernel runs over `rows`; `None` if it does not exist.
    fn place(&self, kernel: &Kernel, bound: &Bound, rows: &Range<u32>) -> Option<(&'a Rows, Range<u32>)> {
        let (array, held) = self.buffers.named(bound.data, self.level_of(kernel), self.exchanged)?;
        let is_source = bound.name.starts_with("source_");
        let rows = self.source.as_ref().filter(|_| is_source).unwrap_or(rows);
        let shown = array.extent.rows_of(self.plan, rows, self.extent_of(kernel), bound.around);
        // Arrays of bands start at the first row of the band.
        Some((held, if array.of_band { 0..shown.end - shown.start } else { shown }))
    }

    /// The bindings of `kernel` for a range of rows.
    fn bindings(&self, kernel: &Kernel, rows: &Range<u32>) -> Vec<Binding> {
        let binding = |bound| self.place(kernel, bound, rows).map(|(array, rows)| array.bind(&rows));
        kernel.bound.iter().map(|bound| binding(bound).unwrap_or_else(|| self.buffers.nothing())).collect()
    }

    /// Records copies.
    pub(super) fn copies(&mut self, copies: impl IntoIterator<Item = Copy>) {
        self.commands.extend(copies.into_iter().map(Command::Copy));
    }

    /// The commands, once they are those of a run that takes about `work` ns on one thread of a processor.
    pub(super) fn complete(mut self, work: f64) -> Vec<Command> {
        let dispatches = |commands: &mut [Command], change: &mut dyn FnMut(&mut u64)| {
            for command in commands {
                if let Command::Dispatch(dispatch) = command {
                    change(&mut dispatch.work);
                }
            }
        };
        let mut shares = 0;
        dispatches(&mut self.commands, &mut |share| shares += *share);
        dispatches(&mut self.commands, &mut |share| *share = (work * *share as f64 / shares as f64) as u64);
        self.commands
    }

    /// Puts the finished successor of `map` in its place.
    pub(super) fn exchange(&mut self, map: Map) {
        self.exchanged.exchange(map);
        self.commands.push(Command::Exchange(map));
    }

    /// Replaces an array by its successor.
    pub(super) fn replace(&mut self, data: Data, next: Data) {
        self.copies(self.array(next).copy_to(self.array(data)));
    }

    /// The rows to record.
    fn own_rows(&self) -> Range<u32> {
        self.only.clone().unwrap_or(0..self.params().height)
    }

    /// Updates the halos of `written` around the rows of its level.
    pub(super) fn renew(&mut self, written: Data) {
        let all = written.level().filter(|z| *z != self.level).map(|z| 0..self.buffers.levels[z].height);
        let rows = all.unwrap_or_else(|| self.own_rows());
        self.copies(self.array(written).exchange(&rows));
    }

    /// Calls `record` at another level, for these rows of it.
    pub(super) fn at<T>(
        &mut self,
        level: usize,
        rows: Range<u32>,
        record: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let here = (self.level, self.only.replace(rows));
        self.level = level;
        let out = record(self);
        (self.level, self.only) = here;
        out
    }

    /// Rows of `level` at which bands must end: the first and last row, and the starts of parts of the
    /// level's volumes, its graph, and the volumes of the next finer level.
    fn cuts(&self, level: usize) -> Vec<u32> {
        let rows = if level == self.level { self.own_rows() } else { 0..self.buffers.levels[level].height };
        let starts = |data: Data| self.array(data).starts();
        let belief = |z: usize| Data::Volume(Volume::Belief(z));
        let mut cuts: BTreeSet<u32> = starts(belief(level)).chain(starts(Data::Members(level))).collect();
        if level > 0 {
            cuts.extend(starts(belief(level - 1)).map(|row| row / 2));
        }
        let between = cuts.into_iter().filter(|row| rows.start < *row && *row < rows.end);
        [rows.start].into_iter().chain(between).chain([rows.end]).collect()
    }

    /// Bands of at most `most` rows for which no binding of `kernels` exceeds the device's largest. The
    /// kernels bind no volumes, and run over the given number of extra rows on either side.
    pub(super) fn bands_of(&self, kernels: &[(&Kernel, u32)], most: usize) -> Result<Vec<Range<u32>>> {
        let height = self.extent_of(kernels[0].0).rows(self.plan) as u32;
        let cuts: Vec<_> = (0..height).step_by(most).chain([height]).collect();
        self.bands(&cuts, kernels)
    }

    /// Like `bands_of`, with bands that end at `cuts`.
    fn bands(&self, cuts: &[u32], kernels: &[(&Kernel, u32)]) -> Result<Vec<Range<u32>>> {
        let limit = self.device.max_binding;
        let size = |kernel: &Kernel, bound: &Bound, rows: &Range<u32>| {
            let Some((array, rows)) = self.place(kernel, bound, rows) else { return 0 };
            let bytes = array.row_bytes() * rows.len() as u64;
            // Arrays of bands may have fewer rows than requested.
            if rows.end > array.height() { bytes.max(limit + 1) } else { bytes }
        };
        let largest = |rows: &Range<u32>| {
            let all = kernels.iter().flat_map(|(kernel, more)| {
                let rows = with_halo(rows, *more, self.extent_of(kernel).rows(self.plan) as u32);
                kernel.bound.iter().map(move |bound| size(kernel, bound, &rows))
            });
            all.max().unwrap_or(0)
        };
        let mut bands = Vec::new();
        for part in cuts.windows(2).map(|ends| ends[0]..ends[1]) {
            let mut rows = part.end - part.start;
            loop {
                let starts = part.clone().step_by(rows as usize);
                let cut: Vec<_> = starts.map(|start| start..(start + rows).min(part.end)).collect();
                let most = cut.iter().map(largest).max().unwrap_or(0);
                if most <= limit {
                    bands.extend(cut);
                    break;
                }
                if rows == 1 {
                    return Err(self.device.too_large(ONE_ROW, most, limit));
                }
                rows -= rows.div_ceil(8).min(rows - 1);
            }
        }
        Ok(bands)
    }

    /// Dispatches `kernel` for the band `rows`, with `size.0` invocations in each of `size.1` rows.
    pub(super) fn dispatch<U: Layout>(
        &mut self,
        kernel: &Kernel<U>,
        own: &U,
        rows: Range<u32>,
        size: (u32, u32),
    ) -> Result<()> {
        self.band(&kernel.any(), bytes_of(own).to_vec(), rows, size)
    }

    fn band(&mut self, kernel: &Kernel, own: Vec<u8>, rows: Range<u32>, size: (u32, u32)) -> Result<()> {
        let bindings = self.bindings(kernel, &rows);
        let level = self.buffers.levels[self.level_of(kernel)];
        let section = Section { level, rows, size, at: (0, 0), own };
        self.dispatch_sections(kernel, &[section], &bindings)
    }

    /// Dispatches `kernel` once for all rows of `levels`, which share buffers. `own` returns the parameters
    /// of a level and its number of invocations per row.
    pub(super) fn levels<U: Layout>(
        &mut self,
        kernel: &Kernel<U>,
        levels: Range<usize>,
        own: impl Fn(usize) -> (U, u32),
    ) -> Result<()> {
        let kernel = kernel.any();
        let sections = levels.clone().map(|z| {
            let (own, threads) = own(z);
            let (level, at) = self.buffers.shared_params(self.plan, z);
            let own = bytes_of(&own).to_vec();
            Section { level, rows: 0..level.height, size: (threads, level.height), at, own }
        });
        let sections: Vec<_> = sections.collect();
        // The shared buffers contain all of the levels.
        let bound = kernel.bound.iter().map(|bound| {
            let named = levels.clone().find_map(|z| self.buffers.named(bound.data, z, self.exchanged));
            named.map_or_else(|| self.buffers.nothing(), |(_, rows)| rows.whole())
        });
        let bindings: Vec<_> = bound.collect();
        self.dispatch_sections(&kernel, &sections, &bindings)
    }

    fn dispatch_sections(
        &mut self,
        kernel: &Kernel,
        sections: &[Section],
        bindings: &[Binding],
    ) -> Result<()> {
        let pipeline = self.pipeline(kernel)?;
        let row_groups = |section: &Section| section.size.0.div_ceil(WORKGROUP).max(1);
        let groups = |section: &Section| u64::from(row_groups(section)) * u64::from(section.size.1);
        let total: u64 = sections.iter().map(groups).sum();
        let grid = total.min(u64::from(self.device.max_groups)).max(1) as u32;
        let (mut bytes, mut first_group) = (Vec::new(), 0);
        for section in sections {
            let Section { level, rows, at: (volume_at, dependency_at), own, .. } = section;
            let band = Band {
                first_row: rows.start,
                rows: rows.end - rows.start,
                row_groups: row_groups(section),
                grid,
                first_group,
                sections: sections.len() as u32,
                volume_at: *volume_at,
                dependency_at: *dependency_at,
            };
            bytes.extend(uniform::bytes(&Header { level: *level, band }, own));
            first_group += groups(section) as u32;
        }
        // The array in the shader has the size for all levels.
        bytes.resize(bytes.len() / sections.len() * kernel.sections, 0);
        let work: u64 = sections.iter().map(|s| u64::from(s.size.0) * u64::from(s.size.1)).sum();
        let device = self.device.inner()?;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = self.device.buffer("uniform", bytes.len() as u64, usage)?;
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
        entries.extend(pipeline.numbers.iter().zip(bindings).map(|(number, binding)| wgpu::BindGroupEntry {
            binding: *number,
            resource: binding.resource(),
        }));
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.inner.get_bind_group_layout(0),
            entries: &entries,
        });
        self.device.write(&uniform, &bytes)?;
        let height = total.div_ceil(u64::from(grid)) as u32;
        let groups = match &mut self.endings {
            None => Groups::Fixed(grid, height),
            Some(endings) => {
                endings.push([grid, height, 1]);
                Groups::UntilSettled(endings.len() - 1)
            }
        };
        self.commands.push(Command::Dispatch(Dispatch {
            pipeline: pipeline.inner,
            bind_group,
            groups,
            work: kernel.loops.max(1) as u64 * work,
        }));
        Ok(())
    }

    /// The pipeline of `kernel`, compiled on first use.
    fn pipeline(&mut self, kernel: &Kernel) -> Result<Pipeline> {
        let Kernel { shader, loops, .. } = kernel;
        if *loops > MAX_LOOP_ITERATIONS {
            let LevelPlan { width, height, labels, .. } = self.plan.levels[0];
            let (neighbours, shader) = (self.plan.neighbours, shader.stage);
            return Err(DeviceError::TooLargeForShader { width, height, labels, neighbours, shader }.into());
        }
        if let Some(pipeline) = self.pipelines.get(shader) {
            return Ok(pipeline.clone());
        }
        let pipeline = Pipeline::compiled(self.device.inner()?, kernel);
        self.device.check()?;
        self.pipelines.insert(shader.clone(), pipeline.clone());
        Ok(pipeline)
    }
}
