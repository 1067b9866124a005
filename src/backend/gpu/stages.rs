//! From the plan to dispatches: what each stage binds, in bands of rows where a buffer exceeds what a device lets a
//! shader see.

use super::buffers::{Binding, Buffers, Copy, Rows, with_halo};
use super::kernels::{JOINED_COLUMNS, Kernel, Params, SEGMENT};
use super::{Gpu, WORKGROUP};
use crate::backend::Stage;
use crate::error::{Error, Result};
use crate::options::{LeftRightCheck, MatchingCost, Median};
use crate::plan::Plan;
use crate::weights::MedianWeights;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

/// What a stage has a device do, in order.
pub(super) enum Step {
    Dispatch(Dispatch),
    Copy(Copy),
}

pub(super) struct Dispatch {
    pub(super) pipeline: wgpu::ComputePipeline,
    pub(super) bind_group: wgpu::BindGroup,
    pub(super) groups: (u32, u32),
    /// Iterations of all loops of all invocations, at most.
    pub(super) work: u64,
}

/// The steps of every stage.
pub(super) type Steps = HashMap<Stage, Arc<[Step]>>;

/// What the dispatches of a kernel have in common.
struct Job<'a> {
    kernel: Kernel,
    plan: &'a Plan,
    level: usize,
    params: Params,
    /// Rows at which a band must end: where parts of volumes do.
    cuts: &'a [u32],
}

fn params(plan: &Plan, buffers: &Buffers, level: usize) -> Params {
    let (scale, method) = (plan.levels[level].evidence, &plan.method);
    Params {
        level: buffers.levels[level].params,
        fine: buffers.levels[level.saturating_sub(1)].params,
        outside_cost: plan.outside_cost.into(),
        colour_weight: plan.colour_weight(),
        colour_variance: plan.colour_variance(),
        sad_radius: (method.cost.sad_window / 2) as i32,
        label_offset: if level == 0 { 0 } else { plan.label_offset(level) },
        evidence_multiplier: scale.multiplier.into(),
        evidence_limit: scale.limit.into(),
        evidence_up: scale.up,
        evidence_down: scale.down,
        evidence_cap: scale.cap.into(),
        belief_most: plan.belief_most().into(),
        sub_pixel: method.refinement.sub_pixel.into(),
        left_right_check: (method.refinement.left_right_check != LeftRightCheck::Off).into(),
        speckle_size: method.refinement.speckle_size,
        confidence_floor: method.refinement.confidence_floor,
        ..Params::default()
    }
}

/// Rows of `level` at which a part of its volumes or of those of the next finer level starts, and its height.
fn cuts(buffers: &Buffers, level: usize) -> Vec<u32> {
    let mut cuts: BTreeSet<u32> = buffers.levels[level].belief.starts().collect();
    if level > 0 {
        cuts.extend(buffers.levels[level - 1].belief.starts().map(|row| row / 2));
    }
    cuts.insert(buffers.levels[level].params.height);
    cuts.into_iter().collect()
}

impl Gpu {
    /// The steps of every stage for `plan` on these buffers, but for [`Stage::Belief`].
    pub(super) fn steps(&mut self, plan: &Plan, buffers: &Buffers) -> Result<Steps> {
        let mut steps = Steps::new();
        let mut add = |stage, what: Vec<Step>| {
            steps.insert(stage, what.into());
        };
        for z in 0..plan.levels.len() {
            let cuts = cuts(buffers, z);
            if z > 0 {
                add(Stage::Pyramid(z), self.pyramid(plan, buffers, z, &cuts)?);
                add(Stage::Resolution(z), self.resolution(plan, buffers, z, &cuts)?);
            }
            if plan.limits_labels() {
                add(Stage::LabelRange(z), self.label_range(plan, buffers, z, &cuts)?);
            }
            add(Stage::Evidence(z), self.evidence(plan, buffers, z, &cuts)?);
            add(Stage::Dependency(z), self.dependency(plan, buffers, z, &cuts)?);
        }
        let cuts = cuts(buffers, 0);
        add(Stage::Cost, self.cost(plan, buffers, &cuts)?);
        add(Stage::Change, self.change_steps(plan, buffers, &cuts)?);
        let method = &plan.method;
        let base = params(plan, buffers, 0);
        let l = base.level;
        let job = |kernel| Job { kernel, plan, level: 0, params: base, cuts: &cuts };
        let belief = &buffers.levels[0].belief;
        let estimate = self.stage(&job(Kernel::WinnerTakesAll), Some(l.width), |r| {
            vec![belief.bind(r), buffers.optima.bind(r)]
        })?;
        add(Stage::WinnerTakesAll, estimate);
        add(Stage::RightView, self.right_view(plan, buffers)?);
        let sub_pixel = self.stage(&job(Kernel::SubPixel), Some(l.width), |rows| {
            let seen = with_halo(rows, 1, l.height);
            vec![
                buffers.levels[0].cost.bind(&seen),
                buffers.optima.bind(&seen),
                buffers.raw.bind(rows),
                buffers.disparity.bind(rows),
            ]
        })?;
        add(Stage::SubPixel, sub_pixel);
        let left_right_check = self.stage(&job(Kernel::LeftRightCheck), Some(l.width), |rows| {
            vec![
                buffers.optima.bind(rows),
                buffers.right_labels.bind(rows),
                buffers.left.bind(rows),
                buffers.flags.bind(rows),
            ]
        })?;
        add(Stage::LeftRightCheck, left_right_check);
        add(Stage::SpeckleFilter, self.speckle_filter(plan, buffers)?);
        let confidence = self.stage(&job(Kernel::Confidence), Some(l.width), |rows| {
            vec![buffers.optima.bind(rows), buffers.flags.bind(rows)]
        })?;
        add(Stage::Confidence, confidence);
        add(Stage::Fill, self.fill(plan, buffers)?);
        let stretched = MedianWeights::stretched(method);
        add(Stage::FillMedian, self.median(plan, buffers, &stretched, &buffers.stretched_weights, false)?);
        let (weights, all) = (MedianWeights::of(method), method.refinement.median == Median::All);
        let median = match method.refinement.median {
            Median::Off => Vec::new(),
            _ => self.median(plan, buffers, &weights, &buffers.median_weights, all)?,
        };
        add(Stage::Median, median);
        Ok(steps)
    }

    fn cost(&mut self, plan: &Plan, buffers: &Buffers, cuts: &[u32]) -> Result<Vec<Step>> {
        let base = params(plan, buffers, 0);
        let l = base.level;
        let job = |kernel| Job { kernel, plan, level: 0, params: base, cuts };
        let cost = &buffers.levels[0].cost;
        let mut steps = if plan.method.cost.matching == MatchingCost::Sad {
            self.stage(&job(Kernel::Sad), Some(l.width.div_ceil(8) * l.quads), |rows| {
                let seen = with_halo(rows, plan.method.cost.sad_window / 2, l.height);
                vec![buffers.left.bind(&seen), buffers.right.bind(&seen), cost.bind(rows)]
            })?
        } else {
            let mut steps = Vec::new();
            for (image, census) in [&buffers.left, &buffers.right].into_iter().zip(&buffers.census) {
                steps.extend(self.stage(&job(Kernel::Census), Some(l.width), |rows| {
                    vec![image.bind(&with_halo(rows, 3, l.height)), census.bind(rows)]
                })?);
            }
            steps.extend(self.stage(&job(Kernel::Contrast), Some(l.width), |rows| {
                vec![buffers.left.bind(&with_halo(rows, 3, l.height)), buffers.contrast.bind(rows)]
            })?);
            steps.extend(self.stage(&job(Kernel::AdCensus), Some(l.width * l.quads), |rows| {
                vec![
                    buffers.left.bind(rows),
                    buffers.right.bind(rows),
                    buffers.census[0].bind(rows),
                    buffers.census[1].bind(rows),
                    buffers.contrast.bind(rows),
                    cost.bind(rows),
                ]
            })?);
            steps
        };
        steps.extend(renewed(cost));
        Ok(steps)
    }

    fn pyramid(&mut self, plan: &Plan, buffers: &Buffers, z: usize, cuts: &[u32]) -> Result<Vec<Step>> {
        let (finer, b) = (&buffers.levels[z - 1], &buffers.levels[z]);
        let (f, l) = (finer.params, b.params);
        let job = Job { kernel: Kernel::Pyramid, plan, level: z, params: params(plan, buffers, z), cuts };
        let mut steps = self.stage(&job, Some(2 * l.width * l.quads), |rows| {
            let fine_rows = with_halo(&(2 * rows.start..(2 * rows.end).min(f.height)), 2, f.height);
            vec![finer.cost.bind(&fine_rows), b.cost.bind(rows)]
        })?;
        steps.extend(renewed(&b.cost));
        Ok(steps)
    }

    fn label_range(&mut self, plan: &Plan, buffers: &Buffers, z: usize, cuts: &[u32]) -> Result<Vec<Step>> {
        let b = &buffers.levels[z];
        let job = Job { kernel: Kernel::LabelRange, plan, level: z, params: params(plan, buffers, z), cuts };
        let threads = Some(b.params.width * b.params.quads);
        let mut steps =
            self.stage(&job, threads, |rows| vec![b.cost.bind(rows), b.label_range.bind(rows)])?;
        steps.extend(renewed(&b.cost));
        Ok(steps)
    }

    fn evidence(&mut self, plan: &Plan, buffers: &Buffers, z: usize, cuts: &[u32]) -> Result<Vec<Step>> {
        let b = &buffers.levels[z];
        let job = Job { kernel: Kernel::Evidence, plan, level: z, params: params(plan, buffers, z), cuts };
        let mut steps = self.stage(&job, Some(b.params.width), |rows| {
            vec![b.cost.bind(rows), b.evidence.bind(rows), b.belief.bind(rows)]
        })?;
        steps.extend(renewed(&b.belief));
        Ok(steps)
    }

    fn dependency(&mut self, plan: &Plan, buffers: &Buffers, z: usize, cuts: &[u32]) -> Result<Vec<Step>> {
        let b = &buffers.levels[z];
        let params = Params { tau: plan.dependency.tau.into(), ..params(plan, buffers, z) };
        let job = Job { kernel: Kernel::Dependency, plan, level: z, params, cuts };
        let mut steps = self.stage(&job, Some(b.params.width), |rows| {
            let seen = with_halo(rows, 3, b.params.height);
            vec![b.members.bind(rows), b.belief.bind(&seen), b.dependency.bind(rows)]
        })?;
        steps.extend(renewed(&b.dependency));
        Ok(steps)
    }

    fn resolution(&mut self, plan: &Plan, buffers: &Buffers, z: usize, cuts: &[u32]) -> Result<Vec<Step>> {
        let (finer, b) = (&buffers.levels[z - 1], &buffers.levels[z]);
        let params = Params { tau: plan.resolution.tau.into(), ..params(plan, buffers, z) };
        let job = Job { kernel: Kernel::Resolution, plan, level: z, params, cuts };
        self.stage(&job, Some(b.params.width), |rows| {
            let fine_rows = 2 * rows.start..(2 * rows.end).min(finer.params.height);
            vec![
                finer.belief.bind(&fine_rows),
                b.belief.bind(rows),
                finer.down.bind(&fine_rows),
                b.up.bind(rows),
            ]
        })
    }

    /// The steps of [`Stage::Belief`]: the graph of the pair decides where rows of the transposed table begin.
    pub(super) fn belief(&mut self, plan: &Plan, buffers: &Buffers, z: usize) -> Result<Vec<Step>> {
        let b = &buffers.levels[z];
        let l = b.params;
        let cuts = cuts(buffers, z);
        let job =
            Job { kernel: Kernel::Belief, plan, level: z, params: params(plan, buffers, z), cuts: &cuts };
        // A level without one kind of messages binds something that is never read.
        let messages = |rows: &Range<u32>, volume: &Rows, there: bool| {
            if there {
                volume.bind(rows)
            } else {
                Binding::whole(volume.buffers().next().expect("a buffer of no rows"))
            }
        };
        let mut steps = self.stage(&job, Some(l.width * (l.quads / 4)), |rows| {
            vec![
                b.evidence.bind(rows),
                b.dependency.bind(&with_halo(rows, 3, l.height)),
                b.starts.bind(rows),
                b.incoming(rows),
                messages(rows, &b.down, z + 1 < plan.levels.len()),
                messages(rows, &b.up, z > 0),
                b.belief.bind(rows),
            ]
        })?;
        steps.extend(renewed(&b.belief));
        Ok(steps)
    }

    /// The steps of [`Stage::RightView`]: the tile decides which columns count.
    pub(super) fn right_view(&mut self, plan: &Plan, buffers: &Buffers) -> Result<Vec<Step>> {
        let (first_column, columns) = (plan.core.start as u32, plan.core.len() as u32);
        let params = Params { first_column, columns, ..params(plan, buffers, 0) };
        let cuts = cuts(buffers, 0);
        let job = Job { kernel: Kernel::RightView, plan, level: 0, params, cuts: &cuts };
        self.stage(&job, Some(params.level.width), |rows| {
            vec![buffers.levels[0].belief.bind(rows), buffers.right_labels.bind(rows)]
        })
    }

    fn change_steps(&mut self, plan: &Plan, buffers: &Buffers, cuts: &[u32]) -> Result<Vec<Step>> {
        let base = params(plan, buffers, 0);
        let job = |kernel| Job { kernel, plan, level: 0, params: base, cuts };
        let mut steps = self.stage(&job(Kernel::Change), Some(base.level.width), |rows| {
            vec![buffers.levels[0].belief.bind(rows), buffers.labels.bind(rows), buffers.squares.bind(rows)]
        })?;
        steps.extend(self.stage(&job(Kernel::ChangeSum), None, |rows| {
            vec![buffers.squares.bind(rows), Binding::whole(&buffers.change_sums)]
        })?);
        Ok(steps)
    }

    /// Regions are found anew in every band, among its rows and so many around it that a region which leaves them is
    /// large enough.
    fn speckle_filter(&mut self, plan: &Plan, buffers: &Buffers) -> Result<Vec<Step>> {
        let halo = plan.method.refinement.speckle_size;
        let base = Params { halo, ..params(plan, buffers, 0) };
        let l = base.level;
        let Buffers { optima, flags, speckle_parents: parents, speckle_sizes: sizes, .. } = buffers;
        // What is found in a band goes to the first rows of the scratch maps.
        let scratch = |seen: &Range<u32>| 0..seen.end - seen.start;
        let bands = self.bands(&[0, l.height], |rows| {
            let seen = with_halo(rows, halo, l.height);
            vec![optima.bind(&seen), flags.bind(&seen), parents.bind(&scratch(&seen))]
        })?;
        let mut steps = Vec::new();
        for rows in bands {
            let seen = with_halo(&rows, halo, l.height);
            let found = |what: &Rows| what.bind(&scratch(&seen));
            let height = seen.end - seen.start;
            let there = Params { first_row: seen.start, rows: height, ..base };
            let mut add = |kernel, params: Params, size: (u32, u32), bindings: Vec<Binding>| {
                let job = Job { kernel, plan, level: 0, params, cuts: &[] };
                steps.push(Step::Dispatch(self.dispatch(&job, &params, size, &bindings)?));
                Ok::<_, Error>(())
            };
            let segments = l.width.div_ceil(SEGMENT);
            let runs = vec![optima.bind(&seen), flags.bind(&seen), found(parents), found(sizes)];
            add(Kernel::SpeckleRuns, there, (segments, height), runs)?;
            let joined = || vec![optima.bind(&seen), found(parents)];
            if segments > 1 {
                add(Kernel::SpeckleJoin, there, (segments - 1, height), joined())?;
                add(Kernel::SpeckleFlatten, there, (l.width, height), vec![found(parents)])?;
            }
            let spans = (0..).map(|k| 1 << k).take_while(|&span: &u32| span < height);
            for span in spans {
                for first_column in (0..l.width).step_by(JOINED_COLUMNS as usize) {
                    let columns = JOINED_COLUMNS.min(l.width - first_column);
                    let borders = (height - span).div_ceil(2 * span);
                    let params = Params { span, first_column, columns, ..there };
                    add(Kernel::SpeckleJoin, params, (columns, borders), joined())?;
                    add(Kernel::SpeckleFlatten, there, (l.width, height), vec![found(parents)])?;
                }
            }
            add(Kernel::SpeckleCount, there, (l.width, height), vec![found(parents), found(sizes)])?;
            let here = Params { first_row: rows.start, rows: rows.end - rows.start, ..base };
            let bindings = vec![found(parents), found(sizes), flags.bind(&rows)];
            add(Kernel::SpeckleFilter, here, (l.width, here.rows), bindings)?;
        }
        Ok(steps)
    }

    fn fill(&mut self, plan: &Plan, buffers: &Buffers) -> Result<Vec<Step>> {
        let base = params(plan, buffers, 0);
        let l = base.level;
        let cuts = [0, l.height];
        let Buffers { disparity, flags, spare_disparity, spare_flags, filled_rows, source_rows, .. } =
            buffers;
        let job = |kernel, params| Job { kernel, plan, level: 0, params, cuts: &cuts };
        let mut steps = self.stage(&job(Kernel::FillRows, base), None, |rows| {
            vec![flags.bind(rows), Binding::whole(filled_rows)]
        })?;
        let every_row = Params { rows: l.height, ..base };
        steps.push(Step::Dispatch(self.dispatch(
            &job(Kernel::FillSources, every_row),
            &every_row,
            (l.height, 1),
            &[Binding::whole(filled_rows), Binding::whole(source_rows)],
        )?));
        // A row may take its values from any other: every band from every band.
        for source in self.bands(&cuts, |rows| vec![flags.bind(rows)])? {
            let params =
                Params { source_first_row: source.start, source_rows: source.end - source.start, ..base };
            steps.extend(self.stage(&job(Kernel::Fill, params), Some(l.width), |rows| {
                vec![
                    disparity.bind(rows),
                    flags.bind(rows),
                    disparity.bind(&source),
                    flags.bind(&source),
                    Binding::whole(source_rows),
                    spare_disparity.bind(rows),
                    spare_flags.bind(rows),
                ]
            })?);
        }
        let copies = spare_disparity.copy_to(disparity).into_iter().chain(spare_flags.copy_to(flags));
        steps.extend(copies.map(Step::Copy));
        Ok(steps)
    }

    /// The median with `weights`, which `table` holds, of `all` pixels or of the filled ones.
    fn median(
        &mut self,
        plan: &Plan,
        buffers: &Buffers,
        weights: &MedianWeights,
        table: &wgpu::Buffer,
        all: bool,
    ) -> Result<Vec<Step>> {
        let (radius, step_bits) = (weights.radius() as u32, weights.step_bits());
        let base = params(plan, buffers, 0);
        let params = Params {
            median_radius: radius,
            median_step_bits: step_bits,
            median_scale: weights.scale(),
            median_doublings: weights.doublings(),
            median_row_bits: weights.row_bits(),
            median_all: all.into(),
            ..base
        };
        let l = base.level;
        let job = Job { kernel: Kernel::Median, plan, level: 0, params, cuts: &[0, l.height] };
        let mut steps = self.stage(&job, Some(l.width), |rows| {
            let seen = with_halo(rows, radius << step_bits, l.height);
            vec![
                buffers.left.bind(&seen),
                buffers.disparity.bind(&seen),
                buffers.flags.bind(&seen),
                Binding::whole(table),
                buffers.spare_disparity.bind(rows),
            ]
        })?;
        steps.extend(buffers.spare_disparity.copy_to(&buffers.disparity).into_iter().map(Step::Copy));
        Ok(steps)
    }

    /// The dispatches of a kernel, one a band: `row_threads` invocations a row (`None`: an invocation a row), `bind`
    /// the buffers for rows of the level.
    fn stage(
        &mut self,
        job: &Job,
        row_threads: Option<u32>,
        bind: impl Fn(&Range<u32>) -> Vec<Binding>,
    ) -> Result<Vec<Step>> {
        let bands = self.bands(job.cuts, &bind)?;
        let dispatches = bands.into_iter().map(|rows| {
            let params = Params { first_row: rows.start, rows: rows.end - rows.start, ..job.params };
            let size = row_threads.map_or((params.rows, 1), |threads| (threads, params.rows));
            self.dispatch(job, &params, size, &bind(&rows)).map(Step::Dispatch)
        });
        dispatches.collect()
    }

    /// Bands of rows between `cuts`, as few as possible, for which no binding exceeds what the device lets a shader
    /// see.
    fn bands(&self, cuts: &[u32], bind: impl Fn(&Range<u32>) -> Vec<Binding>) -> Result<Vec<Range<u32>>> {
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
                    return Err(Error::Memory(format!(
                        "what a row of the image depends on takes {} KiB and {} lets a shader see {} KiB at once: use \
                         --backend cpu, or a smaller image or range",
                        most >> 10,
                        self.device.name,
                        self.device.max_binding >> 10
                    )));
                }
                rows -= rows.div_ceil(8).min(rows - 1);
            }
        }
        Ok(bands)
    }

    /// A dispatch of invocations in `size.1` rows of `size.0`.
    fn dispatch(
        &mut self,
        job: &Job,
        params: &Params,
        size: (u32, u32),
        bindings: &[Binding],
    ) -> Result<Dispatch> {
        let pipeline = self.pipeline(job.kernel, job.plan, job.level)?;
        let row_groups = size.0.div_ceil(WORKGROUP).max(1);
        let total = u64::from(row_groups) * u64::from(size.1);
        let most = u64::from(self.device.max_groups);
        let grid = total.min(most).max(1) as u32;
        let params = Params { row_groups, grid, ..*params };
        let device = self.device.inner()?;
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("params"),
            size: size_of::<Params>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }];
        entries.extend(
            bindings.iter().zip(1..).map(|(binding, place)| wgpu::BindGroupEntry {
                binding: place,
                resource: binding.resource(),
            }),
        );
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        self.device.write(&uniform, bytemuck::bytes_of(&params))?;
        let loops = job.kernel.loop_iterations(job.plan, job.level).max(1) as u64;
        Ok(Dispatch {
            pipeline,
            bind_group,
            groups: (grid, total.div_ceil(u64::from(grid)) as u32),
            work: loops * u64::from(size.0) * u64::from(size.1),
        })
    }
}

/// What parts hold of each other, once `written` is.
fn renewed(written: &Rows) -> impl Iterator<Item = Step> {
    written.exchange().into_iter().map(Step::Copy)
}
