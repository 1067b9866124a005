//! Turns stages into dispatches, in bands of rows where a buffer exceeds the device's largest binding.

use super::buffers::{Buffers, LevelBuffers};
use super::device::{Device, ONE_ROW};
use super::kernel::{Bindings, Kernel, MAX_LOOP_ITERATIONS};
use super::rows::{Binding, Copy, Rows};
use super::shader::{Shader, WORKGROUP, binding_number};
use super::uniform::{self, Band, Header, LevelParams};
use crate::error::{DeviceError, Result};
use crate::plan::{LevelPlan, Plan};
use bytemuck::bytes_of;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// The commands of a stage, in order.
pub(super) enum Command {
    Dispatch(Dispatch),
    Copy(Copy),
    /// Makes a range of bytes 0.
    Clear(wgpu::Buffer, Range<u64>),
}

pub(super) struct Dispatch {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) groups: Groups,
    /// Largest total number of loop iterations of all invocations.
    pub(super) work: u64,
}

/// Workgroups of a dispatch.
pub(super) enum Groups {
    /// So many in x and y.
    Fixed(u32, u32),
    /// As many as stand at this place of [`Buffers::groups`]: none, once the label map has settled.
    UntilSettled(usize),
}

/// A compiled kernel.
#[derive(Clone)]
pub(super) struct Pipeline {
    inner: wgpu::ComputePipeline,
    /// The binding number of each of its names.
    numbers: Vec<u32>,
}

/// Compiled kernels.
pub(super) type Pipelines = HashMap<Shader, Pipeline>;

/// What a dispatch does at a level.
struct Section {
    level: LevelParams,
    rows: Range<u32>,
    /// Invocations in each of so many rows.
    size: (u32, u32),
    /// Where volumes and dependency messages begin in what is bound, in quads.
    at: (u32, u32),
    /// The bytes of the stage's own uniform.
    own: Vec<u8>,
}

/// What is bound for a range of rows.
type Bind<'a> = dyn Fn(&Range<u32>) -> Vec<Binding> + 'a;

/// Collects the commands of a stage at a level. Only its entry points are generic over kernels, so that the rest is compiled once.
pub(super) struct Recorder<'a> {
    pub(super) device: &'a mut Device,
    pub(super) pipelines: &'a mut Pipelines,
    pub(super) plan: &'a Plan,
    pub(super) buffers: &'a Buffers,
    pub(super) level: usize,
    /// The rows of the level to record; `None` for all.
    pub(super) only: Option<Range<u32>>,
    /// Where the workgroups of dispatches go that end when the label map has settled.
    pub(super) endings: Option<&'a mut Vec<[u32; 3]>>,
    pub(super) commands: Vec<Command>,
}

impl<'a> Recorder<'a> {
    /// The buffers of the level.
    pub(super) fn here(&self) -> &'a LevelBuffers {
        &self.buffers.levels[self.level]
    }

    /// The buffers of the next finer level.
    pub(super) fn finer(&self) -> &'a LevelBuffers {
        &self.buffers.levels[self.level - 1]
    }

    /// A level of `levels`, whose buffers hold all of them.
    pub(super) fn shared(&self, levels: &Range<usize>) -> &'a LevelBuffers {
        &self.buffers.levels[levels.end - 1]
    }

    /// The parameters of the level, as the shaders get them.
    pub(super) fn params(&self) -> LevelParams {
        self.here().params
    }

    /// Dispatches `kernel` for the rows of the level, with `threads` invocations per row and one dispatch per
    /// band. `bind` gives the buffers for a range of rows.
    pub(super) fn rows<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        own: &B::Uniform,
        threads: u32,
        bind: impl Fn(&Range<u32>) -> B,
    ) -> Result<()> {
        self.each_band(&kernel.any(), bytes_of(own), &|height| (threads, height), &|rows| bind(rows).all())
    }

    /// The same with one invocation per row.
    pub(super) fn one_a_row<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        own: &B::Uniform,
        bind: impl Fn(&Range<u32>) -> B,
    ) -> Result<()> {
        self.each_band(&kernel.any(), bytes_of(own), &|height| (height, 1), &|rows| bind(rows).all())
    }

    fn each_band(
        &mut self,
        kernel: &Kernel,
        own: &[u8],
        size: &dyn Fn(u32) -> (u32, u32),
        bind: &Bind,
    ) -> Result<()> {
        for rows in self.bands(&self.cuts(), bind)? {
            let (size, bindings) = (size(rows.end - rows.start), bind(&rows));
            self.band(kernel, own.to_vec(), rows, size, &bindings)?;
        }
        Ok(())
    }

    /// Records a copy.
    pub(super) fn copies(&mut self, copies: impl IntoIterator<Item = Copy>) {
        self.commands.extend(copies.into_iter().map(Command::Copy));
    }

    /// The rows to record.
    fn own_rows(&self) -> Range<u32> {
        self.only.clone().unwrap_or(0..self.params().height)
    }

    /// Updates the halos of `written` around the rows of the level.
    pub(super) fn renew(&mut self, written: &Rows) {
        self.copies(written.exchange(&self.own_rows()));
    }

    /// Makes the rows of `volume` 0, halos included.
    pub(super) fn clear(&mut self, volume: &Rows) {
        let rows = self.own_rows();
        self.commands
            .extend(volume.within(&rows).map(|(buffer, bytes)| Command::Clear(buffer.clone(), bytes)));
        self.renew(volume);
    }

    /// Does `record` at another level, for these rows of it.
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

    /// Rows at which a band must end: the first and the last one, and between them the starts of the parts of the level's volumes,
    /// of its graph and of the volumes of the next finer level.
    fn cuts(&self) -> Vec<u32> {
        let (here, rows) = (self.here(), self.own_rows());
        let mut cuts: BTreeSet<u32> = here.belief.starts().chain(here.members.starts()).collect();
        if self.level > 0 {
            cuts.extend(self.finer().belief.starts().map(|row| row / 2));
        }
        let between = cuts.into_iter().filter(|row| rows.start < *row && *row < rows.end);
        [rows.start].into_iter().chain(between).chain([rows.end]).collect()
    }

    /// Bands of all rows, as few as possible, such that no binding exceeds the device's largest. For bindings
    /// that hold no volumes.
    pub(super) fn map_bands(&self, bind: &Bind) -> Result<Vec<Range<u32>>> {
        self.bands(&[0, self.params().height], bind)
    }

    /// The same between given `cuts`.
    fn bands(&self, cuts: &[u32], bind: &Bind) -> Result<Vec<Range<u32>>> {
        let largest = |rows: &Range<u32>| bind(rows).iter().map(Binding::size).max().unwrap_or(0);
        let mut bands = Vec::new();
        for part in cuts.windows(2).map(|ends| ends[0]..ends[1]) {
            let mut rows = part.end - part.start;
            loop {
                let starts = part.clone().step_by(rows as usize);
                let cut: Vec<_> = starts.map(|start| start..(start + rows).min(part.end)).collect();
                let most = cut.iter().map(largest).max().unwrap_or(0);
                if most <= self.device.max_binding {
                    bands.extend(cut);
                    break;
                }
                if rows == 1 {
                    return Err(self.device.too_large(ONE_ROW, most, self.device.max_binding));
                }
                rows -= rows.div_ceil(8).min(rows - 1);
            }
        }
        Ok(bands)
    }

    /// Dispatches `kernel` for the band `rows`, with `size.0` invocations in each of `size.1` rows.
    pub(super) fn dispatch<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        own: &B::Uniform,
        rows: Range<u32>,
        size: (u32, u32),
        bindings: B,
    ) -> Result<()> {
        self.band(&kernel.any(), bytes_of(own).to_vec(), rows, size, &bindings.all())
    }

    fn band(
        &mut self,
        kernel: &Kernel,
        own: Vec<u8>,
        rows: Range<u32>,
        size: (u32, u32),
        bindings: &[Binding],
    ) -> Result<()> {
        let section = Section { level: self.params(), rows, size, at: (0, 0), own };
        self.dispatch_sections(kernel, &[section], bindings)
    }

    /// Dispatches `kernel` for all rows of `levels` at once, which share their buffers. `own` gives the parameters of a level and its number of invocations in a row.
    pub(super) fn levels<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        levels: Range<usize>,
        own: impl Fn(usize) -> (B::Uniform, u32),
        bindings: B,
    ) -> Result<()> {
        let sections = levels.map(|z| {
            let (here, (own, threads)) = (&self.buffers.levels[z], own(z));
            let (level, at) = here.shared_params(self.plan);
            let own = bytes_of(&own).to_vec();
            Section { level, rows: 0..level.height, size: (threads, level.height), at, own }
        });
        self.dispatch_sections(&kernel.any(), &sections.collect::<Vec<_>>(), &bindings.all())
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
        // The shader's array has room for all levels.
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
        let Kernel { shader, loops, names, .. } = kernel;
        if *loops > MAX_LOOP_ITERATIONS {
            let LevelPlan { width, height, labels, .. } = self.plan.levels[0];
            let (neighbours, shader) = (self.plan.neighbours, shader.stage);
            return Err(DeviceError::TooLargeForShader { width, height, labels, neighbours, shader }.into());
        }
        if let Some(pipeline) = self.pipelines.get(shader) {
            return Ok(pipeline.clone());
        }
        let source = shader.source();
        let number = |name: &&str| binding_number(&source, name).expect("the shader has what is bound");
        let numbers = names.iter().map(number).collect();
        let device = self.device.inner()?;
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
        self.device.check()?;
        let pipeline = Pipeline { inner, numbers };
        self.pipelines.insert(shader.clone(), pipeline.clone());
        Ok(pipeline)
    }
}
