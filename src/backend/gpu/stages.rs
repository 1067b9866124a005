//! From the plan to dispatches: what each stage binds, in bands of rows where a volume exceeds what a device lets a
//! shader see at once.

use super::kernels::{Kernel, Params};
use super::upload::image_words;
use super::{Buffers, Dispatch, Gpu, LevelBuffers};
use crate::error::{Error, Result};
use crate::image::Pair;
use crate::options::Cost;
use crate::plan::Plan;
use crate::tables;
use std::ops::Range;

/// The dispatches of every stage, by level where there is one a level.
#[derive(Default)]
pub(super) struct Stages {
    pub(super) cost: Vec<Dispatch>,
    pub(super) pyramid: Vec<Vec<Dispatch>>,
    pub(super) evidence: Vec<Vec<Dispatch>>,
    pub(super) dependency: Vec<Vec<Dispatch>>,
    pub(super) resolution: Vec<Vec<Dispatch>>,
    pub(super) belief: Vec<Vec<Dispatch>>,
    pub(super) estimate: Vec<Dispatch>,
    pub(super) change: Vec<Dispatch>,
}

/// A range of a buffer to bind, at a byte offset that is a multiple of 256.
pub(super) struct Binding {
    pub(super) buffer: wgpu::Buffer,
    pub(super) bytes: Range<u64>,
}

impl Binding {
    /// Rows of `words` 32-bit words each.
    fn rows(buffer: &wgpu::Buffer, words: u32, rows: &Range<u32>) -> Self {
        let bytes = 4 * u64::from(words);
        Self { buffer: buffer.clone(), bytes: bytes * u64::from(rows.start)..bytes * u64::from(rows.end) }
    }

    fn whole(buffer: &wgpu::Buffer) -> Self {
        Self { buffer: buffer.clone(), bytes: 0..buffer.size() }
    }

    /// Bytes that are bound; an empty buffer is bound whole, for shaders that name but never read it.
    pub(super) fn size(&self) -> u64 {
        let end = self.bytes.end.min(self.buffer.size());
        end.saturating_sub(self.bytes.start)
    }
}

/// `rows` with up to `halo` rows above and below.
fn with_halo(rows: &Range<u32>, halo: u32, height: u32) -> Range<u32> {
    rows.start.saturating_sub(halo)..(rows.end + halo).min(height)
}

impl Gpu {
    /// The dispatches of every stage for `plan` on these buffers.
    pub(super) fn stages(&mut self, plan: &Plan, pair: &Pair, state: &Buffers) -> Result<Stages> {
        let mut stages = Stages::default();
        for (z, b) in state.levels.iter().enumerate() {
            let l = b.params;
            let scale = plan.levels[z].evidence;
            let base = Params {
                level: l,
                fine: state.levels[z.saturating_sub(1)].params,
                outside_cost: plan.outside_cost.into(),
                sad_radius: (plan.method.sad_window / 2) as i32,
                label_offset: if z == 0 { 0 } else { plan.label_offset(z) },
                evidence_multiplier: scale.multiplier,
                evidence_limit: scale.limit,
                evidence_cap: scale.cap,
                ..Params::default()
            };
            let words = plan.message_bytes() as u32;
            let cost_words = if z == 0 { l.pitch } else { 2 * l.pitch };
            if z == 0 {
                stages.cost = self.cost_stages(plan, pair, &base, &b.cost)?;
                stages.pyramid.push(Vec::new());
                stages.resolution.push(Vec::new());
            } else {
                let finer = &state.levels[z - 1];
                let f = finer.params;
                let fine_cost_words = if z == 1 { f.pitch } else { 2 * f.pitch };
                let threads = Some(2 * l.width * l.quads);
                stages.pyramid.push(self.stage(Kernel::Pyramid, plan, z, &base, threads, |rows| {
                    let fine_rows = with_halo(&(2 * rows.start..(2 * rows.end).min(f.height)), 2, f.height);
                    vec![
                        Binding::rows(&finer.cost, fine_cost_words, &fine_rows),
                        Binding::rows(&b.cost, cost_words, rows),
                    ]
                })?);
                let params = Params { tau: plan.resolution.tau.into(), ..base };
                stages.resolution.push(self.stage(
                    Kernel::Resolution,
                    plan,
                    z,
                    &params,
                    Some(l.width),
                    |rows| {
                        let fine_rows = 2 * rows.start..(2 * rows.end).min(f.height);
                        vec![
                            Binding::rows(&finer.belief, 2 * f.pitch, &fine_rows),
                            Binding::rows(&b.belief, 2 * l.pitch, rows),
                            Binding::rows(&finer.down, words * f.pitch, &fine_rows),
                            Binding::rows(&b.up, words * l.pitch, rows),
                        ]
                    },
                )?);
            }
            stages.evidence.push(self.stage(Kernel::Evidence, plan, z, &base, Some(l.width), |rows| {
                vec![
                    Binding::rows(&b.cost, cost_words, rows),
                    Binding::rows(&b.evidence, l.pitch, rows),
                    Binding::rows(&b.belief, 2 * l.pitch, rows),
                ]
            })?);
            let params = Params { tau: plan.dependency.tau.into(), ..base };
            stages.dependency.push(self.stage(
                Kernel::Dependency,
                plan,
                z,
                &params,
                Some(l.width),
                |rows| {
                    vec![
                        Binding::rows(&b.members, l.member_pitch, rows),
                        Binding::rows(&b.belief, 2 * l.pitch, &with_halo(rows, 3, l.height)),
                        Binding::rows(&b.dependency, l.dependency_pitch, rows),
                    ]
                },
            )?);
            let incoming = |rows: &Range<u32>| {
                let bytes = |row: u32| 4 * u64::from(b.incoming_rows[row as usize]);
                Binding { buffer: b.incoming.clone(), bytes: bytes(rows.start)..bytes(rows.end) }
            };
            let threads = Some(l.width * (l.quads / 4));
            stages.belief.push(self.stage(Kernel::Belief, plan, z, &base, threads, |rows| {
                vec![
                    Binding::rows(&b.evidence, l.pitch, rows),
                    Binding::rows(&b.dependency, l.dependency_pitch, &with_halo(rows, 3, l.height)),
                    Binding::rows(&b.starts, l.starts_pitch, rows),
                    incoming(rows),
                    if z + 1 == state.levels.len() {
                        Binding::whole(&b.down)
                    } else {
                        Binding::rows(&b.down, words * l.pitch, rows)
                    },
                    if z == 0 { Binding::whole(&b.up) } else { Binding::rows(&b.up, words * l.pitch, rows) },
                    Binding::rows(&b.belief, 2 * l.pitch, rows),
                ]
            })?);
            if z == 0 {
                stages.estimate = self.estimate_stages(plan, &base, b, state)?;
                stages.change = self.change_stages(plan, &base, &b.belief, state)?;
            }
        }
        Ok(stages)
    }

    fn cost_stages(
        &mut self,
        plan: &Plan,
        pair: &Pair,
        base: &Params,
        cost: &wgpu::Buffer,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let images = [
            self.uploaded("left", &image_words(pair.left(), l.pixel_pitch))?,
            self.uploaded("right", &image_words(pair.right(), l.pixel_pitch))?,
        ];
        let image_rows =
            |image: &wgpu::Buffer, rows: &Range<u32>| Binding::rows(image, 4 * l.pixel_pitch, rows);
        if plan.method.cost == Cost::Sad {
            let threads = Some(l.width.div_ceil(8) * l.quads);
            return self.stage(Kernel::Sad, plan, 0, base, threads, |rows| {
                let seen = with_halo(rows, plan.method.sad_window / 2, l.height);
                vec![
                    image_rows(&images[0], &seen),
                    image_rows(&images[1], &seen),
                    Binding::rows(cost, l.pitch, rows),
                ]
            });
        }
        let words = 2 * u64::from(l.pixel_pitch) * u64::from(l.height);
        let census = [self.buffer("left census", words)?, self.buffer("right census", words)?];
        let census_rows =
            |census: &wgpu::Buffer, rows: &Range<u32>| Binding::rows(census, 2 * l.pixel_pitch, rows);
        let mut dispatches = Vec::new();
        for (image, census) in images.iter().zip(&census) {
            dispatches.extend(self.stage(Kernel::Census, plan, 0, base, Some(l.width), |rows| {
                vec![image_rows(image, &with_halo(rows, 3, l.height)), census_rows(census, rows)]
            })?);
        }
        let entries: Vec<u32> =
            tables::ad_cost().into_iter().chain(tables::census_cost()).map(u32::from).collect();
        let table = self.uploaded("tables", &entries)?;
        dispatches.extend(self.stage(Kernel::AdCensus, plan, 0, base, Some(l.width * l.quads), |rows| {
            vec![
                image_rows(&images[0], rows),
                image_rows(&images[1], rows),
                census_rows(&census[0], rows),
                census_rows(&census[1], rows),
                Binding::whole(&table),
                Binding::rows(cost, l.pitch, rows),
            ]
        })?);
        Ok(dispatches)
    }

    fn estimate_stages(
        &mut self,
        plan: &Plan,
        base: &Params,
        level: &LevelBuffers,
        state: &Buffers,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let belief_rows = |rows: &Range<u32>| Binding::rows(&level.belief, 2 * l.pitch, rows);
        let peak_rows = |rows: &Range<u32>| Binding::rows(&state.peaks, 2 * l.pixel_pitch, rows);
        let threads = Some(l.width);
        let mut dispatches = self.stage(Kernel::Estimate, plan, 0, base, threads, |rows| {
            vec![belief_rows(rows), peak_rows(rows)]
        })?;
        dispatches.extend(self.stage(Kernel::SubPixel, plan, 0, base, threads, |rows| {
            let seen = with_halo(rows, 1, l.height);
            vec![
                Binding::rows(&level.cost, l.pitch, &seen),
                peak_rows(&seen),
                Binding::rows(&state.offsets, l.pixel_pitch, rows),
            ]
        })?);
        dispatches.extend(self.stage(Kernel::RightView, plan, 0, base, threads, |rows| {
            vec![belief_rows(rows), Binding::rows(&state.right_labels, l.pixel_pitch, rows)]
        })?);
        Ok(dispatches)
    }

    fn change_stages(
        &mut self,
        plan: &Plan,
        base: &Params,
        belief: &wgpu::Buffer,
        state: &Buffers,
    ) -> Result<Vec<Dispatch>> {
        let l = base.level;
        let words = u64::from(l.pixel_pitch) * u64::from(l.height);
        let (labels, squares) = (self.buffer("labels", words)?, self.buffer("squares", words)?);
        let mut dispatches = self.stage(Kernel::Change, plan, 0, base, Some(l.width), |rows| {
            vec![
                Binding::rows(belief, 2 * l.pitch, rows),
                Binding::rows(&labels, l.pixel_pitch, rows),
                Binding::rows(&squares, l.pixel_pitch, rows),
            ]
        })?;
        dispatches.extend(self.stage(Kernel::ChangeSum, plan, 0, base, None, |rows| {
            vec![Binding::rows(&squares, l.pixel_pitch, rows), Binding::whole(&state.change_sums)]
        })?);
        Ok(dispatches)
    }

    /// The dispatches of `kernel` at `level`, one a band: `row_threads` invocations a row (`None`: an invocation a row),
    /// `bind` the buffers for rows of the level.
    fn stage(
        &mut self,
        kernel: Kernel,
        plan: &Plan,
        level: usize,
        params: &Params,
        row_threads: Option<u32>,
        bind: impl Fn(&Range<u32>) -> Vec<Binding>,
    ) -> Result<Vec<Dispatch>> {
        let pipeline = self.pipeline(kernel, plan, level)?;
        let bands = self.bands(params.level.height, &bind)?;
        let dispatches = bands.into_iter().map(|rows| {
            let params = Params { first_row: rows.start, rows: rows.len() as u32, ..*params };
            let threads = row_threads.map_or((params.rows, 1), |threads| (threads, params.rows));
            self.dispatch(&pipeline, &params, &bind(&rows), threads)
        });
        Ok(dispatches.collect())
    }

    /// Bands of rows, as few as possible, for which no binding exceeds what the device lets a shader see.
    fn bands(&self, height: u32, bind: impl Fn(&Range<u32>) -> Vec<Binding>) -> Result<Vec<Range<u32>>> {
        let largest = |rows: &Range<u32>| bind(rows).iter().map(Binding::size).max().unwrap_or(0);
        // No more rows than a device has workgroups in a dimension.
        let mut rows = height.min(65_535);
        loop {
            let bands: Vec<_> =
                (0..height.div_ceil(rows)).map(|i| i * rows..((i + 1) * rows).min(height)).collect();
            let most = bands.iter().map(largest).max().unwrap_or(0);
            if most <= self.device.max_binding {
                return Ok(bands);
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
}
