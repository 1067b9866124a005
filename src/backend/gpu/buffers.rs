//! The buffers of a match, allocated once, from the plan alone.
//!
//! Where they fit, levels share buffers, so that one dispatch can go over several of them.

use super::allocator::{Allocator, USAGE};
use super::convergence::Convergence;
use super::device::Device;
use super::full_buffers::FullBuffers;
use super::patch_buffers::PatchBuffers;
use super::rows::{HALO, Pool, Rows};
use super::uniform::{ALIGN_WORDS, LevelParams};
use super::vote_buffers::VoteBuffers;
use super::words::window_words;
use crate::error::{MemoryError, Result};
use crate::image::Plane;
use crate::options::Fill;
use crate::plan::{LevelPlan, Plan, RING_PART};
use crate::stage::Stage;
use crate::weights::MedianWeights;
use std::array;

/// All buffers of a match on a device.
pub(super) struct Buffers {
    /// The finest level that shares buffers with all coarser ones; the number of levels where none does.
    pub(super) finest_shared: usize,
    /// A guide on its way to its level.
    pub(super) next_guide: wgpu::Buffer,
    pub(super) levels: Vec<LevelBuffers>,
    pub(super) left: Rows,
    pub(super) right: Rows,
    /// Census of the left and of the right image.
    pub(super) census: [Rows; 2],
    /// Weight of colour in the matching cost.
    pub(super) contrast: Rows,
    pub(super) median_weights: wgpu::Buffer,
    pub(super) fill_weights: wgpu::Buffer,
    /// Label map of the last change, and its squared differences.
    pub(super) labels: Rows,
    pub(super) squares: Rows,
    /// Sums of the squared changes of each row, lower and upper half.
    pub(super) change_sums: wgpu::Buffer,
    /// Whether the label map has settled.
    pub(super) convergence: wgpu::Buffer,
    /// Workgroups of the dispatches that end when it has: as they are now, and from the start.
    pub(super) groups: wgpu::Buffer,
    pub(super) all_groups: wgpu::Buffer,
    /// Number of these dispatches.
    pub(super) endings: u32,
    pub(super) optima: Rows,
    pub(super) right_labels: Rows,
    pub(super) raw: Rows,
    pub(super) disparity: Rows,
    /// Validity and confidence.
    pub(super) flags: Rows,
    /// Output of a stage that reads around a pixel, until it replaces the map that was read.
    pub(super) spare_disparity: Rows,
    pub(super) spare_flags: Rows,
    pub(super) speckle_parents: Rows,
    pub(super) speckle_sizes: Rows,
    /// Whether each row holds a valid pixel, and the row that it takes its values from.
    pub(super) filled_rows: wgpu::Buffer,
    pub(super) source_rows: wgpu::Buffer,
    /// `None` where the method fills without votes.
    pub(super) votes: Option<VoteBuffers>,
    /// `None` where the method does without planes from far away.
    pub(super) patches: Option<PatchBuffers>,
    /// `None` where the pair is matched at its full size.
    pub(super) full: Option<FullBuffers>,
    written: Vec<wgpu::Buffer>,
    constant: Vec<wgpu::Buffer>,
}

/// Volumes of one level.
pub(super) struct LevelBuffers {
    pub(super) params: LevelParams,
    pub(super) cost: Rows,
    pub(super) evidence: Rows,
    pub(super) dependency: Rows,
    pub(super) down: Rows,
    pub(super) up: Rows,
    pub(super) belief: Rows,
    /// Label windows, first label | number of labels with padding << 16.
    pub(super) windows: Rows,
    /// Those that hold all labels.
    pub(super) full_windows: wgpu::Buffer,
    /// Lowest and highest candidate of each pixel, for the windows of the next finer level.
    pub(super) candidates: Rows,
    /// First and last label of each pixel; empty where all labels are allowed.
    pub(super) label_range: Rows,
    /// What members are chosen by; at level 0 the left image.
    pub(super) guide: Rows,
    pub(super) members: Rows,
    /// Which factors hold each pixel.
    pub(super) incoming: Rows,
}

impl LevelBuffers {
    /// The parameters of the level where what it shares is bound, and where its volumes and its dependency messages begin there,
    /// in quads.
    pub(super) fn shared_params(&self, plan: &Plan) -> (LevelParams, (u32, u32)) {
        let quad = 4 * plan.volume_width.bytes() as u64;
        let params = LevelParams {
            members_at: self.members.start(4),
            incoming_at: self.incoming.start(8),
            windows_at: self.windows.start(4),
            ..self.params
        };
        (params, (self.belief.start(quad), self.dependency.start(quad)))
    }

    /// Where its guide begins in what it shares, in pixels.
    pub(super) fn guide_at(&self) -> u32 {
        self.guide.start(16)
    }

    /// The buffers of the volumes that nobody needs any more once there are labels.
    fn dead_volumes(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        let rows = [&self.evidence, &self.belief, &self.dependency, &self.down, &self.up];
        rows.into_iter().flat_map(Rows::buffers)
    }

    /// The message volumes, which start at 0.
    pub(super) fn messages(&self) -> [&Rows; 3] {
        [&self.dependency, &self.down, &self.up]
    }
}

/// What levels share, by name and place.
const SHARED: [&str; 9] = [
    "evidence",
    "dependency messages",
    "messages from above",
    "messages from below",
    "belief",
    "label windows",
    "guide",
    "members",
    "transposed table",
];
const EVIDENCE: usize = 0;
const DEPENDENCY: usize = 1;
const DOWN: usize = 2;
const UP: usize = 3;
const BELIEF: usize = 4;
const WINDOWS: usize = 5;
const GUIDE: usize = 6;
const MEMBERS: usize = 7;
const INCOMING: usize = 8;
/// Those with a value for each label.
const VOLUMES: [usize; 5] = [EVIDENCE, DEPENDENCY, DOWN, UP, BELIEF];

/// The sizes of what a level may share.
struct Words {
    /// Words in a row.
    in_row: [u32; SHARED.len()],
    rows: [u32; SHARED.len()],
}

impl Words {
    fn of(plan: &Plan, z: usize) -> Self {
        let p = LevelParams::new(plan, &plan.levels[z]);
        let bytes = plan.volume_width.bytes() as u32;
        let values = bytes * p.pitch;
        let windows = full_windows(&plan.levels[z]).len() as u32;
        let mut rows = [p.height; SHARED.len()];
        rows[WINDOWS] = 1;
        let dependency = bytes * p.dependency_pitch;
        let (guide, incoming) = (4 * p.pixel_pitch, 2 * p.pixel_pitch);
        let in_row = [p.pitch, dependency, values, values, values, windows, guide, p.member_pitch, incoming];
        Self { in_row, rows }
    }

    fn all(&self, kind: usize) -> u64 {
        u64::from(self.in_row[kind]) * u64::from(self.rows[kind])
    }
}

/// Label windows that hold all labels, in as many words as can be bound.
fn full_windows(level: &LevelPlan) -> Vec<u32> {
    let (runs, rows) = level.windows();
    let mut words = window_words(&Plane::filled(runs, rows, [0, level.stride as u16]));
    words.resize(words.len().next_multiple_of(ALIGN_WORDS), 0);
    words
}

/// First rows of the parts of a level, and its height, where the widest rows have so many words. They are even, so that the two
/// rows of a coarser pixel stay together; none has more than `most`.
fn part_starts(device: &Device, plan: &Plan, height: u32, widest: u32, most: u32) -> Result<Vec<u32>> {
    let fitting = device.max_buffer / (4 * u64::from(widest));
    if fitting.min(u64::from(most)) >= u64::from(height) {
        return Ok(vec![0, height]);
    }
    let own = fitting.saturating_sub(2 * u64::from(HALO)).min(u64::from(most)) as u32 & !1;
    if own == 0 {
        let rows = 2 + 2 * HALO;
        let what = format!("{rows} rows of {} labels", plan.levels[0].labels);
        return Err(device.too_large(what, 4 * u64::from(rows) * u64::from(widest), device.max_buffer));
    }
    Ok((0..height).step_by(own as usize).chain([height]).collect())
}

impl Buffers {
    /// All buffers for `plan`.
    ///
    /// # Errors
    /// [`Error::Memory`] when it does not fit, [`Error::Device`] when the device fails.
    pub(super) fn new(device: &mut Device, plan: &Plan) -> Result<Self> {
        if let Some(available) = device.memory.filter(|&m| m < plan.bytes()) {
            let (name, needed) = (device.name.clone(), plan.bytes());
            return Err(MemoryError::Device { name, needed, available }.into());
        }
        let mut allocator = Allocator::new(device);
        let a = &mut allocator;
        let last = plan.levels.len() - 1;
        let finest_shared = Self::finest_shared(a.device, plan);
        let mut shared = Self::shared(a, plan, finest_shared)?;
        let none = [0, 0];
        let mut levels = Vec::new();
        for (z, level) in plan.levels.iter().enumerate().rev() {
            let p = LevelParams::new(plan, level);
            let words = Words::of(plan, z);
            let narrow = words.in_row[INCOMING].max(words.in_row[MEMBERS]);
            let wide = words.in_row[DEPENDENCY].max(2 * p.pitch);
            let streamed = z == 0 && !plan.holds_all_rows();
            let starts =
                part_starts(a.device, plan, p.height, if streamed { narrow } else { wide }, u32::MAX)?;
            // The parts of the volumes, and how many of them there is room for.
            let most = if streamed { RING_PART as u32 } else { u32::MAX };
            let in_turns = part_starts(a.device, plan, p.height, wide, most)?;
            let count = if streamed { plan.ring_parts(in_turns[1] as usize) } else { usize::MAX };
            let windows = full_windows(level);
            let mut rows = |kind: usize, starts: &[u32]| match shared.get_mut(kind) {
                Some(pool) if z >= finest_shared => Ok(pool.rows(words.in_row[kind], words.rows[kind])),
                _ if streamed && VOLUMES.contains(&kind) => {
                    a.ring(SHARED[kind], words.in_row[kind], &in_turns, count)
                }
                _ => a.rows(SHARED[kind], words.in_row[kind], starts),
            };
            let whole = [0, p.height];
            let up = if z == 0 { None } else { Some(rows(UP, &starts)?) };
            levels.push(LevelBuffers {
                evidence: rows(EVIDENCE, &starts)?,
                dependency: rows(DEPENDENCY, &starts)?,
                down: rows(DOWN, if z == last { &none } else { &starts })?,
                belief: rows(BELIEF, &starts)?,
                windows: rows(WINDOWS, &[0, 1])?,
                guide: rows(GUIDE, &whole)?,
                members: rows(MEMBERS, &starts)?,
                incoming: rows(INCOMING, &starts)?,
                // What a level does not have still needs a binding in the shaders.
                up: up.map_or_else(|| a.rows(SHARED[UP], words.in_row[UP], &none), Ok)?,
                full_windows: a.constant("full label windows", &windows)?,
                cost: match z {
                    0 if streamed => a.ring("cost", p.pitch, &in_turns, count)?,
                    0 => a.rows("cost", p.pitch, &starts)?,
                    _ => a.rows("cost", 2 * p.pitch, &starts)?,
                },
                candidates: a.rows("candidates", p.pixel_pitch, if z == 0 { &none } else { &starts })?,
                label_range: a.rows(
                    "label ranges",
                    p.pixel_pitch,
                    if plan.limits_labels() { &starts } else { &none },
                )?,
                params: p,
            });
        }
        levels.reverse();
        if plan.shares {
            // Levels share buffers, and so do parts that take turns.
            for buffer in levels.iter().flat_map(LevelBuffers::dead_volumes) {
                if !a.spare.contains(buffer) {
                    a.spare.push(buffer.clone());
                }
            }
        }
        let fine = levels[0].params;
        let whole = [0, fine.height];
        let next_guide = levels.get(1).map_or(0, |l| 4 * u64::from(l.params.pixel_pitch * l.params.height));
        let next_guide = a.buffer("next guide", next_guide)?;
        let mut map = |label: &str, words: u32| a.rows(label, words * fine.pixel_pitch, &whole);
        let has_votes = plan.method.refinement.fill == Fill::Votes;
        let full = plan.full.is_some();
        let rows = u64::from(fine.height);
        Ok(Self {
            left: levels[0].guide.clone(),
            right: map("right image", 4)?,
            census: [map("left census", 2)?, map("right census", 2)?],
            contrast: map("contrast", 1)?,
            labels: map("labels", 1)?,
            squares: map("squares", 1)?,
            optima: map("optima", 2)?,
            right_labels: map("right labels", 1)?,
            raw: map("raw", 1)?,
            disparity: map("disparity", 1)?,
            flags: map("flags", 1)?,
            spare_disparity: map("spare disparity", 1)?,
            spare_flags: map("spare flags", 1)?,
            speckle_parents: map("speckle parents", 1)?,
            speckle_sizes: map("speckle sizes", 1)?,
            full: full.then(|| FullBuffers::new(a, &fine)).transpose()?,
            votes: has_votes.then(|| VoteBuffers::new(a, plan, &fine)).transpose()?,
            patches: (Stage::FarPlane.descriptor().taken)(&plan.method)
                .then(|| PatchBuffers::new(a, plan, &fine))
                .transpose()?,
            median_weights: a.constant("median weights", &MedianWeights::of(&plan.method).words())?,
            // What distance subtracts is the same for all steps.
            fill_weights: a
                .constant("fill weights", &MedianWeights::of_filled(&plan.method, [0; 2]).words())?,
            change_sums: a.buffer("change", 2 * rows)?,
            convergence: a.buffer("convergence", size_of::<Convergence>() as u64 / 4)?,
            groups: a.buffer("groups", 0)?,
            all_groups: a.constant("groups", &[])?,
            endings: 0,
            filled_rows: a.buffer("filled rows", rows)?,
            source_rows: a.buffer("source rows", rows)?,
            finest_shared,
            next_guide,
            levels,
            written: allocator.written,
            constant: allocator.constant,
        })
    }

    /// The finest level that shares buffers with all coarser ones: as many as fit in what a shader may see at once.
    pub(super) fn finest_shared(device: &Device, plan: &Plan) -> usize {
        let most = device.max_binding.min(device.max_buffer) / 4;
        // A level of which some rows are held at a time keeps them for itself.
        let first = usize::from(!plan.holds_all_rows());
        let mut sizes = [0; SHARED.len()];
        let mut finest = plan.levels.len();
        while finest > first {
            let words = Words::of(plan, finest - 1);
            sizes = array::from_fn(|kind| sizes[kind] + words.all(kind));
            if sizes.iter().any(|&words| words > most) {
                break;
            }
            finest -= 1;
        }
        finest
    }

    /// The buffers that the levels from `finest` on share.
    fn shared(a: &mut Allocator, plan: &Plan, finest: usize) -> Result<Vec<Pool>> {
        let levels = finest..plan.levels.len();
        let words = |kind: usize| {
            // Level 0 has no messages from below.
            let levels = levels.clone().filter(|z| (*z, kind) != (0, UP));
            levels.map(|z| Words::of(plan, z).all(kind)).sum()
        };
        let pools = SHARED.iter().enumerate().filter(|_| !levels.is_empty());
        pools.map(|(kind, label)| Ok(Pool::new(a.buffer(label, words(kind))?))).collect()
    }

    /// A guide of these parameters on its way to its level.
    pub(super) fn next_guide(&self, params: &LevelParams) -> Rows {
        Pool::new(self.next_guide.clone()).rows(4 * params.pixel_pitch, params.height)
    }

    /// Makes room for the workgroups of the dispatches that end when the map has settled.
    pub(super) fn end_when_settled(&mut self, device: &mut Device, groups: &[[u32; 3]]) -> Result<()> {
        let usage = wgpu::BufferUsages::INDIRECT | USAGE;
        let words = groups.as_flattened();
        let mut allocator = Allocator::new(device);
        self.all_groups = allocator.constant("groups", words)?;
        self.groups = allocator.allocate("groups", words.len() as u64, usage)?;
        self.written.push(self.groups.clone());
        self.constant.append(&mut allocator.constant);
        self.endings = groups.len() as u32;
        Ok(())
    }

    /// The buffers that matches write.
    pub(super) fn written(&self) -> &[wgpu::Buffer] {
        &self.written
    }

    /// Bytes of all buffers.
    pub(super) fn bytes(&self) -> u64 {
        self.written.iter().chain(&self.constant).map(wgpu::Buffer::size).sum()
    }
}
