//! The buffers of a match, allocated once, from the plan alone.
//!
//! A volume larger than the device's largest buffer is split into parts of whole rows. Each part also holds a
//! halo: a few rows of its neighbours, so that a stage that reads around a pixel finds everything in one
//! part. A stage that writes a volume with a halo ends with copies that update those rows.
//!
//! Where they fit, levels share buffers, so that one dispatch can go over several of them.

use super::convergence::Convergence;
use super::device::Device;
use super::uniform::{ALIGN_WORDS, LevelParams};
use super::words::window_words;
use crate::error::{MemoryError, Result};
use crate::image::Plane;
use crate::plan::{GRAPH_WINDOW, LevelPlan, Plan};
use crate::weights::MedianWeights;
use std::array;
use std::num::NonZero;
use std::ops::Range;

/// Halo of a part, in rows on either side: as far as any stage reads around a pixel in a volume.
pub(super) const HALO: u32 = GRAPH_WINDOW as u32 / 2;

/// What stages and copies do with buffers.
const USAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_DST).union(wgpu::BufferUsages::COPY_SRC);

/// `rows` with up to `halo` rows above and below.
pub(super) fn with_halo(rows: &Range<u32>, halo: u32, height: u32) -> Range<u32> {
    rows.start.saturating_sub(halo)..rows.end.saturating_add(halo).min(height)
}

/// Data stored row by row, in as few buffers as the device allows.
#[derive(Clone)]
pub(super) struct Rows {
    parts: Vec<Part>,
    row_bytes: u64,
}

#[derive(Clone)]
struct Part {
    buffer: wgpu::Buffer,
    /// The rows that it owns.
    own: Range<u32>,
    /// The rows that it holds, halo included.
    held: Range<u32>,
    /// Where they begin in the buffer, in bytes.
    offset: u64,
}

impl Part {
    /// Where `row` begins in the buffer.
    fn at(&self, row: u32, row_bytes: u64) -> u64 {
        self.offset + u64::from(row - self.held.start) * row_bytes
    }
}

/// A range of a buffer to bind, at a byte offset that is a multiple of 256.
#[derive(Clone)]
pub(super) struct Binding {
    buffer: wgpu::Buffer,
    bytes: Range<u64>,
}

impl Binding {
    pub(super) fn whole(buffer: &wgpu::Buffer) -> Self {
        Self { buffer: buffer.clone(), bytes: 0..buffer.size() }
    }

    /// Number of bytes that are bound.
    pub(super) fn size(&self) -> u64 {
        let end = self.bytes.end.min(self.buffer.size());
        end.saturating_sub(self.bytes.start)
    }

    pub(super) fn resource(&self) -> wgpu::BindingResource<'_> {
        wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &self.buffer,
            offset: self.bytes.start,
            size: NonZero::new(self.size()),
        })
    }
}

/// A copy of bytes from one buffer to another.
#[derive(Clone)]
pub(super) struct Copy {
    pub(super) from: (wgpu::Buffer, u64),
    pub(super) to: (wgpu::Buffer, u64),
    pub(super) bytes: u64,
}

impl Rows {
    /// Binds `rows`, which one part owns, with as much of their halo as that part holds: for a stage that
    /// writes the rows, or reads around them.
    pub(super) fn bind(&self, rows: &Range<u32>) -> Binding {
        let within = |outer: &Range<u32>| outer.start <= rows.start && rows.end <= outer.end;
        let part = self.parts.iter().find(|p| within(&p.own)).or(self.parts.iter().find(|p| within(&p.held)));
        let part = part.expect("bands stay within parts, and halos within what parts hold");
        let at = |row: u32| part.at(row, self.row_bytes);
        Binding { buffer: part.buffer.clone(), bytes: at(rows.start)..at(rows.end) }
    }

    /// Copies that update the halos of all parts.
    pub(super) fn exchange(&self) -> Vec<Copy> {
        let mut copies = Vec::new();
        for (i, to) in self.parts.iter().enumerate() {
            for (j, from) in self.parts.iter().enumerate() {
                let rows = to.held.start.max(from.own.start)..to.held.end.min(from.own.end);
                if i != j && !rows.is_empty() {
                    let at = |part: &Part| part.at(rows.start, self.row_bytes);
                    copies.push(Copy {
                        from: (from.buffer.clone(), at(from)),
                        to: (to.buffer.clone(), at(to)),
                        bytes: rows.len() as u64 * self.row_bytes,
                    });
                }
            }
        }
        copies
    }

    /// Copies of all rows to `to`, which has the same rows.
    pub(super) fn copy_to(&self, to: &Self) -> Vec<Copy> {
        let pairs = self.parts.iter().zip(&to.parts);
        pairs
            .map(|(from, to)| Copy {
                from: (from.buffer.clone(), from.offset),
                to: (to.buffer.clone(), to.offset),
                bytes: from.held.len() as u64 * self.row_bytes,
            })
            .collect()
    }

    /// First row of each part.
    pub(super) fn starts(&self) -> impl Iterator<Item = u32> {
        self.parts.iter().map(|p| p.own.start)
    }

    pub(super) fn buffers(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        self.parts.iter().map(|p| &p.buffer)
    }

    /// Each part's buffer, and the byte range of its own rows in it.
    pub(super) fn own(&self) -> Vec<(wgpu::Buffer, Range<u64>)> {
        let at = |p: &Part, row: u32| p.at(row, self.row_bytes);
        self.parts.iter().map(|p| (p.buffer.clone(), at(p, p.own.start)..at(p, p.own.end))).collect()
    }

    /// Each part's buffer, and the byte range of all its rows in it.
    pub(super) fn held(&self) -> impl Iterator<Item = (&wgpu::Buffer, Range<u64>)> {
        let at = |p: &Part, row: u32| p.at(row, self.row_bytes);
        self.parts.iter().map(move |p| (&p.buffer, at(p, p.held.start)..at(p, p.held.end)))
    }

    /// Where the first row begins in its buffer, in elements of so many bytes.
    fn start(&self, bytes: u64) -> u32 {
        (self.parts[0].offset / bytes) as u32
    }

    /// Writes the words of all rows.
    pub(super) fn write(&self, device: &mut Device, words: &[u32]) -> Result<()> {
        let per_row = self.row_bytes as usize / 4;
        for part in &self.parts {
            let held = part.held.start as usize * per_row..part.held.end as usize * per_row;
            device.write_at(&part.buffer, part.offset, bytemuck::cast_slice(&words[held]))?;
        }
        Ok(())
    }
}

/// One buffer for several levels, coarsest first.
struct Pool {
    buffer: wgpu::Buffer,
    /// Words that are taken.
    taken: u64,
}

impl Pool {
    /// The next `height` rows of `words` words each.
    fn rows(&mut self, words: u32, height: u32) -> Rows {
        let (all, offset) = (0..height, 4 * self.taken);
        self.taken += u64::from(words) * u64::from(height);
        let part = Part { buffer: self.buffer.clone(), own: all.clone(), held: all, offset };
        Rows { parts: vec![part], row_bytes: 4 * u64::from(words) }
    }
}

/// The buffers that the coarser levels share.
pub(super) struct Shared {
    /// The finest of these levels.
    pub(super) finest: usize,
    pub(super) evidence: wgpu::Buffer,
    pub(super) dependency: wgpu::Buffer,
    pub(super) down: wgpu::Buffer,
    pub(super) up: wgpu::Buffer,
    pub(super) belief: wgpu::Buffer,
    pub(super) windows: wgpu::Buffer,
    pub(super) guide: wgpu::Buffer,
    pub(super) members: wgpu::Buffer,
    pub(super) incoming: wgpu::Buffer,
}

/// All buffers of a match on a device.
pub(super) struct Buffers {
    /// `None` where not even the coarsest level fits.
    pub(super) shared: Option<Shared>,
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
    pub(super) stretched_weights: wgpu::Buffer,
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
    /// The parameters of the level where what it [shares](Shared) is bound, and where its volumes and its dependency messages begin there,
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

    /// The message volumes, which start at 0.
    pub(super) fn messages(&self) -> [&Rows; 3] {
        [&self.dependency, &self.down, &self.up]
    }
}

/// Allocates buffers, and keeps track of them.
struct Allocator<'a> {
    device: &'a mut Device,
    written: Vec<wgpu::Buffer>,
    constant: Vec<wgpu::Buffer>,
}

impl Allocator<'_> {
    /// A buffer that matches write.
    fn buffer(&mut self, label: &str, words: u64) -> Result<wgpu::Buffer> {
        let buffer = self.allocate(label, words, USAGE)?;
        self.written.push(buffer.clone());
        Ok(buffer)
    }

    /// A buffer that keeps these words from match to match.
    fn constant(&mut self, label: &str, words: &[u32]) -> Result<wgpu::Buffer> {
        let buffer = self.allocate(label, words.len() as u64, USAGE)?;
        self.device.write(&buffer, bytemuck::cast_slice(words))?;
        self.constant.push(buffer.clone());
        Ok(buffer)
    }

    fn allocate(&self, label: &str, words: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let size = (4 * words).max(4 * ALIGN_WORDS as u64);
        let (name, largest) = (&self.device.name, self.device.max_buffer);
        if size > largest {
            let (name, what) = (name.clone(), format!("the {label}"));
            return Err(MemoryError::Buffer { name, what, needed: size, allowed: largest }.into());
        }
        let buffer = self.device.inner()?.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        });
        self.device.check()?;
        Ok(buffer)
    }

    /// Rows of `words` words each, in parts that start at `starts`, whose last element is the height.
    fn rows(&mut self, label: &str, words: u32, starts: &[u32]) -> Result<Rows> {
        let height = starts[starts.len() - 1];
        let parts = starts.windows(2).map(|ends| {
            let own = ends[0]..ends[1];
            let held = with_halo(&own, HALO, height);
            let buffer = self.buffer(label, u64::from(words) * held.len() as u64)?;
            Ok(Part { buffer, own, held, offset: 0 })
        });
        Ok(Rows { parts: parts.collect::<Result<_>>()?, row_bytes: 4 * u64::from(words) })
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

/// First rows of the parts of a level, and its height. They are even, so that the two rows of a coarser pixel
/// stay together.
fn part_starts(device: &Device, plan: &Plan, params: &LevelParams) -> Result<Vec<u32>> {
    let bytes = plan.volume_width.bytes() as u32;
    let widest = (bytes * params.dependency_pitch).max(2 * params.pitch);
    let fitting = device.max_buffer / (4 * u64::from(widest));
    if fitting >= u64::from(params.height) {
        return Ok(vec![0, params.height]);
    }
    let own = fitting.saturating_sub(2 * u64::from(HALO)) as u32 & !1;
    if own == 0 {
        let rows = 2 + 2 * HALO;
        return Err(MemoryError::Buffer {
            name: device.name.clone(),
            what: format!("{rows} rows of {} labels", plan.levels[0].labels),
            needed: 4 * u64::from(rows) * u64::from(widest),
            allowed: device.max_buffer,
        }
        .into());
    }
    Ok((0..params.height).step_by(own as usize).chain([params.height]).collect())
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
        let mut allocator = Allocator { device, written: Vec::new(), constant: Vec::new() };
        let a = &mut allocator;
        let last = plan.levels.len() - 1;
        let (finest, mut shared) = Self::shared(a, plan)?;
        let none = [0, 0];
        let mut levels = Vec::new();
        for (z, level) in plan.levels.iter().enumerate().rev() {
            let p = LevelParams::new(plan, level);
            let starts = part_starts(a.device, plan, &p)?;
            let words = Words::of(plan, z);
            let windows = full_windows(level);
            let mut rows = |kind: usize, starts: &[u32]| match &mut shared {
                Some(pools) if z >= finest => Ok(pools[kind].rows(words.in_row[kind], words.rows[kind])),
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
                cost: a.rows("cost", if z == 0 { p.pitch } else { 2 * p.pitch }, &starts)?,
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
        let fine = levels[0].params;
        let whole = [0, fine.height];
        let next_guide = levels.get(1).map_or(0, |l| 4 * u64::from(l.params.pixel_pitch * l.params.height));
        let next_guide = a.buffer("next guide", next_guide)?;
        let mut map = |label: &str, words: u32| a.rows(label, words * fine.pixel_pitch, &whole);
        let (left, right) = (levels[0].guide.clone(), map("right image", 4)?);
        let census = [map("left census", 2)?, map("right census", 2)?];
        let contrast = map("contrast", 1)?;
        let (labels, squares) = (map("labels", 1)?, map("squares", 1)?);
        let (optima, right_labels) = (map("optima", 2)?, map("right labels", 1)?);
        let (raw, disparity, flags) = (map("raw", 1)?, map("disparity", 1)?, map("flags", 1)?);
        let (spare_disparity, spare_flags) = (map("spare disparity", 1)?, map("spare flags", 1)?);
        let (speckle_parents, speckle_sizes) = (map("speckle parents", 1)?, map("speckle sizes", 1)?);
        let rows = u64::from(fine.height);
        Ok(Self {
            median_weights: a.constant("median weights", &MedianWeights::of(&plan.method).words())?,
            stretched_weights: a
                .constant("stretched weights", &MedianWeights::stretched(&plan.method).words())?,
            change_sums: a.buffer("change", 2 * rows)?,
            convergence: a.buffer("convergence", size_of::<Convergence>() as u64 / 4)?,
            groups: a.buffer("groups", 0)?,
            all_groups: a.constant("groups", &[])?,
            endings: 0,
            filled_rows: a.buffer("filled rows", rows)?,
            source_rows: a.buffer("source rows", rows)?,
            shared: shared.map(|pools| {
                let [evidence, dependency, down, up, belief, windows, guide, members, incoming] =
                    pools.map(|pool| pool.buffer);
                Shared { finest, evidence, dependency, down, up, belief, windows, guide, members, incoming }
            }),
            next_guide,
            levels,
            left,
            right,
            census,
            contrast,
            labels,
            squares,
            optima,
            right_labels,
            raw,
            disparity,
            flags,
            spare_disparity,
            spare_flags,
            speckle_parents,
            speckle_sizes,
            written: allocator.written,
            constant: allocator.constant,
        })
    }

    /// The finest level that shares buffers, and these: as many levels as fit in what a shader may see at once.
    fn shared(a: &mut Allocator, plan: &Plan) -> Result<(usize, Option<[Pool; SHARED.len()]>)> {
        let most = a.device.max_binding.min(a.device.max_buffer) / 4;
        let mut sizes = [0; SHARED.len()];
        let mut finest = plan.levels.len();
        while finest > 0 {
            let words = Words::of(plan, finest - 1);
            let more: [u64; SHARED.len()] = array::from_fn(|kind| sizes[kind] + words.all(kind));
            if more.iter().any(|&words| words > most) {
                break;
            }
            (sizes, finest) = (more, finest - 1);
        }
        if finest == plan.levels.len() {
            return Ok((finest, None));
        }
        if finest == 0 {
            // Level 0 has no messages from below.
            sizes[UP] -= Words::of(plan, 0).all(UP);
        }
        let mut pools = Vec::new();
        for (label, words) in SHARED.iter().zip(sizes) {
            pools.push(Pool { buffer: a.buffer(label, words)?, taken: 0 });
        }
        Ok((finest, pools.try_into().ok()))
    }

    /// A guide of these parameters on its way to its level.
    pub(super) fn next_guide(&self, params: &LevelParams) -> Rows {
        Pool { buffer: self.next_guide.clone(), taken: 0 }.rows(4 * params.pixel_pitch, params.height)
    }

    /// Makes room for the workgroups of the dispatches that end when the map has settled.
    pub(super) fn end_when_settled(&mut self, device: &mut Device, groups: &[[u32; 3]]) -> Result<()> {
        let usage = wgpu::BufferUsages::INDIRECT | USAGE;
        let words = groups.as_flattened();
        let mut allocator = Allocator { device, written: Vec::new(), constant: Vec::new() };
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
