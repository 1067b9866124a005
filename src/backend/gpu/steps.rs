//! Turns stages into dispatches, in bands of rows where a buffer exceeds the device's largest binding.

use super::buffers::{Buffers, LevelBuffers};
use super::device::Device;
use super::rows::{Binding, Copy, Rows};
use super::shader::{Kernel, WORKGROUP};
use super::uniform::{self, Band, Header, Layout, LevelParams, UniformLayout};
use crate::error::{DeviceError, MemoryError, Result};
use crate::plan::{LevelPlan, Plan};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// Largest total number of loop iterations of one invocation.
pub const MAX_LOOP_ITERATIONS: usize = 32_768;

/// The commands of a stage, in order.
pub(super) enum Step {
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

/// Compiled kernels.
pub(super) type Pipelines = HashMap<Kernel, wgpu::ComputePipeline>;

/// A kernel as a plan specialises it, before there is a device.
#[derive(Clone, Debug)]
pub struct Job {
    /// The entry point and its constants.
    pub kernel: Kernel,
    /// Largest total number of loop iterations of one invocation. Mesa 22 stops a shader silently after about
    /// 65,000.
    pub loops: usize,
    /// The uniform that it reads: one, or an array of one for each of so many levels.
    pub uniform: UniformLayout,
    sections: Option<usize>,
}

impl Job {
    /// `kernel` with `U` as the stage's own uniform, and at most `loops` loop iterations.
    pub(super) fn new<U: Layout>(kernel: Kernel, loops: usize) -> Self {
        Self { kernel, loops, uniform: UniformLayout::of::<U>(), sections: None }
    }

    /// The same for a kernel that may go over as many levels at once as `plan` has.
    pub(super) fn over_levels(self, plan: &Plan) -> Self {
        let levels = plan.levels.len();
        Self { kernel: self.kernel.with("SECTIONS", levels as u32), sections: Some(levels), ..self }
    }
}

/// Buffers to bind, each with its binding number in the shader.
pub(super) type Bindings = Vec<(u32, Binding)>;

/// What a dispatch does at a level.
struct Section<U> {
    level: LevelParams,
    rows: Range<u32>,
    /// Invocations in each of so many rows.
    size: (u32, u32),
    /// Where volumes and dependency messages begin in what is bound, in quads.
    at: (u32, u32),
    own: U,
}

/// Collects the commands of a stage at a level.
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
    pub(super) steps: Vec<Step>,
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

    /// The parameters of the level, as the shaders get them.
    pub(super) fn params(&self) -> LevelParams {
        self.here().params
    }

    /// Dispatches `job` for the rows of the level, with `threads` invocations per row and one dispatch per
    /// band. `bind` gives the buffers for a range of rows.
    pub(super) fn rows<U: Layout>(
        &mut self,
        job: &Job,
        own: &U,
        threads: u32,
        bind: impl Fn(&Range<u32>) -> Bindings,
    ) -> Result<()> {
        for rows in self.bands(&self.cuts(), &bind)? {
            let bindings = bind(&rows);
            let height = rows.end - rows.start;
            self.dispatch(job, own, rows, (threads, height), &bindings)?;
        }
        Ok(())
    }

    /// The same with one invocation per row.
    pub(super) fn one_a_row<U: Layout>(
        &mut self,
        job: &Job,
        own: &U,
        bind: impl Fn(&Range<u32>) -> Bindings,
    ) -> Result<()> {
        for rows in self.bands(&self.cuts(), &bind)? {
            let bindings = bind(&rows);
            let height = rows.end - rows.start;
            self.dispatch(job, own, rows, (height, 1), &bindings)?;
        }
        Ok(())
    }

    /// Records a copy.
    pub(super) fn copies(&mut self, copies: impl IntoIterator<Item = Copy>) {
        self.steps.extend(copies.into_iter().map(Step::Copy));
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
        self.steps.extend(volume.within(&rows).map(|(buffer, bytes)| Step::Clear(buffer.clone(), bytes)));
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
    pub(super) fn map_bands(&self, bind: impl Fn(&Range<u32>) -> Bindings) -> Result<Vec<Range<u32>>> {
        self.bands(&[0, self.params().height], bind)
    }

    /// The same between given `cuts`.
    fn bands(&self, cuts: &[u32], bind: impl Fn(&Range<u32>) -> Bindings) -> Result<Vec<Range<u32>>> {
        let largest = |rows: &Range<u32>| bind(rows).iter().map(|(_, b)| b.size()).max().unwrap_or(0);
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
                    return Err(MemoryError::Buffer {
                        name: self.device.name.clone(),
                        what: "one row of the image and what it depends on".into(),
                        needed: most,
                        allowed: self.device.max_binding,
                    }
                    .into());
                }
                rows -= rows.div_ceil(8).min(rows - 1);
            }
        }
        Ok(bands)
    }

    /// Dispatches `job` for the band `rows`, with `size.0` invocations in each of `size.1` rows.
    pub(super) fn dispatch<U: Layout>(
        &mut self,
        job: &Job,
        own: &U,
        rows: Range<u32>,
        size: (u32, u32),
        bindings: &[(u32, Binding)],
    ) -> Result<()> {
        self.dispatch_sections(
            job,
            &[Section { level: self.params(), rows, size, at: (0, 0), own: *own }],
            bindings,
        )
    }

    /// Dispatches `job` for all rows of `levels` at once, which [share](super::buffers::Shared) their buffers. `own` gives the
    /// parameters of a level and its number of invocations in a row.
    pub(super) fn levels<U: Layout>(
        &mut self,
        job: &Job,
        levels: Range<usize>,
        own: impl Fn(usize) -> (U, u32),
        bindings: &[(u32, &wgpu::Buffer)],
    ) -> Result<()> {
        let sections = levels.map(|z| {
            let (here, (own, threads)) = (&self.buffers.levels[z], own(z));
            let (level, at) = here.shared_params(self.plan);
            Section { level, rows: 0..level.height, size: (threads, level.height), at, own }
        });
        let bindings: Bindings = bindings.iter().map(|(place, b)| (*place, Binding::whole(b))).collect();
        self.dispatch_sections(job, &sections.collect::<Vec<_>>(), &bindings)
    }

    fn dispatch_sections<U: Layout>(
        &mut self,
        job: &Job,
        sections: &[Section<U>],
        bindings: &[(u32, Binding)],
    ) -> Result<()> {
        let pipeline = self.pipeline(job)?;
        let row_groups = |section: &Section<U>| section.size.0.div_ceil(WORKGROUP).max(1);
        let groups = |section: &Section<U>| u64::from(row_groups(section)) * u64::from(section.size.1);
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
        bytes.resize(bytes.len() / sections.len() * job.sections.unwrap_or(1), 0);
        let work: u64 = sections.iter().map(|s| u64::from(s.size.0) * u64::from(s.size.1)).sum();
        let device = self.device.inner()?;
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("uniform"),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
        entries.extend(
            bindings.iter().map(|(place, binding)| wgpu::BindGroupEntry {
                binding: *place,
                resource: binding.resource(),
            }),
        );
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
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
        self.steps.push(Step::Dispatch(Dispatch {
            pipeline,
            bind_group,
            groups,
            work: job.loops.max(1) as u64 * work,
        }));
        Ok(())
    }

    /// The pipeline of `job`, compiled on first use.
    fn pipeline(&mut self, job: &Job) -> Result<wgpu::ComputePipeline> {
        let Job { kernel, loops, .. } = job;
        if *loops > MAX_LOOP_ITERATIONS {
            let LevelPlan { width, height, labels, .. } = self.plan.levels[0];
            let (neighbours, shader) = (self.plan.neighbours, kernel.stage());
            return Err(DeviceError::TooLargeForShader { width, height, labels, neighbours, shader }.into());
        }
        if let Some(pipeline) = self.pipelines.get(kernel) {
            return Ok(pipeline.clone());
        }
        let device = self.device.inner()?;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(kernel.stage()),
            source: wgpu::ShaderSource::Wgsl(kernel.source().into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(kernel.stage()),
            layout: None,
            module: &module,
            entry_point: Some(kernel.entry()),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.device.check()?;
        self.pipelines.insert(kernel.clone(), pipeline.clone());
        Ok(pipeline)
    }
}
