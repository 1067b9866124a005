//! The buffers of a match, allocated once from the plan and its table of data ([`Data::array`]).
//!
//! Levels share buffers if they fit, so that one dispatch can process several levels.

use super::allocator::{Allocator, USAGE};
use super::device::{Device, ONE_ROW};
use super::rows::{Binding, HALO, Pool, Rows};
use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::error::{MemoryError, Result};
use crate::plan::{Plan, RING_PART};
use crate::stage::{Array, Data, Extent, Map, Place, Start, Volume};
use std::array;
use std::collections::HashMap;

/// The maps that a stage computes anew while it reads them, and where their successors are written.
const SUCCESSORS: [(Map, Data); 2] =
    [(Map::Disparity, Data::NextDisparity), (Map::Validity, Data::NextFlags)];

/// Whether each of these maps is in the memory of its successor, and the successor in that of the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Exchanged([bool; SUCCESSORS.len()]);

impl Exchanged {
    /// The successor of `map` takes its place, and `map` that of the successor.
    pub(super) fn exchange(&mut self, map: Map) {
        let at = SUCCESSORS.iter().position(|(of, _)| *of == map).expect("the map has a successor");
        self.0[at] ^= true;
    }
}

/// All buffers of a match on a device.
pub(super) struct Buffers {
    /// The finest level that shares buffers with all coarser ones; the number of levels if none does.
    pub(super) finest_shared: usize,
    /// The parameters of each level.
    pub(super) levels: Vec<LevelParams>,
    /// Every array by name and level.
    arrays: HashMap<(&'static str, usize), (Array, Rows)>,
    /// The maps that are in the memory of their successors now.
    pub(super) exchanged: Exchanged,
    /// For each array that an exchange moves: the index of the exchange in [`SUCCESSORS`], and its rows after it.
    elsewhere: HashMap<&'static str, (usize, Rows)>,
    /// Bound in place of missing arrays, because WGSL bindings cannot be absent.
    nothing: wgpu::Buffer,
    /// Workgroup counts of the dispatches that end once the label map has settled: current and initial ones.
    pub(super) groups: wgpu::Buffer,
    pub(super) all_groups: wgpu::Buffer,
    /// Number of these dispatches.
    pub(super) endings: u32,
    /// Arrays that are zeroed when a match starts.
    pub(super) zeroed: Vec<Data>,
    written: Vec<wgpu::Buffer>,
    constant: Vec<wgpu::Buffer>,
}

/// First rows of the parts of a level, and its height, for rows of up to `widest` words. They are even, so
/// that both rows of a coarser pixel stay together. No part has more than `most` rows.
fn part_starts(device: &Device, plan: &Plan, height: u32, widest: usize, most: u32) -> Result<Vec<u32>> {
    let fitting = device.max_buffer / (4 * widest as u64);
    if fitting.min(u64::from(most)) >= u64::from(height) {
        return Ok(vec![0, height]);
    }
    let own = fitting.saturating_sub(2 * u64::from(HALO)).min(u64::from(most)) as u32 & !1;
    if own == 0 {
        let rows = 2 + 2 * HALO;
        let what = format!("{rows} rows of {} labels", plan.levels[0].labels);
        return Err(device.too_large(what, 4 * u64::from(rows) * widest as u64, device.max_buffer));
    }
    Ok((0..height).step_by(own as usize).chain([height]).collect())
}

/// The split of the rows of a level into parts.
struct Parts {
    whole: [u32; 2],
    /// The parts of its graph, and of its volumes if all their rows are held.
    starts: Vec<u32>,
    /// For a ring of rows: the parts of the volumes, which share its buffers, and the number of buffers.
    in_turns: Option<(Vec<u32>, usize)>,
}

impl Parts {
    fn of(device: &Device, plan: &Plan, z: usize) -> Result<Self> {
        let words = |data: Data| data.array(plan).words;
        let narrow = words(Data::Incoming(z)).max(words(Data::Members(z)));
        // A volume with two bytes per label is the widest besides the one with all slots.
        let wide =
            words(Data::Volume(Volume::Dependency(z))).max(2 * words(Data::Volume(Volume::Evidence(z))));
        let height = plan.levels[z].height as u32;
        let streamed = z == 0 && !plan.holds_all_rows();
        let starts = part_starts(device, plan, height, if streamed { narrow } else { wide }, u32::MAX)?;
        let in_turns = streamed.then(|| {
            let starts = part_starts(device, plan, height, wide, RING_PART as u32)?;
            let count = plan.ring_parts(starts[1] as usize);
            Ok::<_, crate::error::Error>((starts, count))
        });
        Ok(Self { whole: [0, height], starts, in_turns: in_turns.transpose()? })
    }

    /// Allocates an array of the level.
    fn rows(&self, a: &mut Allocator, data: Data, array: &Array) -> Result<Rows> {
        let words = array.words as u32;
        match (&self.in_turns, data) {
            (Some((starts, count)), Data::Volume(_)) => a.ring(array.name, words, starts, *count),
            (_, Data::Guide(_) | Data::NextGuide(_)) => a.rows(array.name, words, &self.whole),
            _ if array.extent == Extent::Table => a.rows(array.name, words, &[0, 1]),
            _ => a.rows(array.name, words, &self.starts),
        }
    }
}

impl Buffers {
    /// All buffers for `plan`.
    ///
    /// # Errors
    /// [`Error::Memory`] if it does not fit, [`Error::Device`] if the device fails.
    pub(super) fn new(device: &mut Device, plan: &Plan) -> Result<Self> {
        if let Some(available) = device.memory.filter(|&m| m < plan.bytes()) {
            let (name, needed) = (device.name.clone(), plan.bytes());
            return Err(MemoryError::Device { name, needed, available }.into());
        }
        let mut allocator = Allocator::new(device);
        let a = &mut allocator;
        let finest_shared = Self::finest_shared(a.device, plan);
        let levels: Vec<_> = plan.levels.iter().map(|level| LevelParams::new(plan, level)).collect();
        let mut arrays = HashMap::new();
        let pools =
            (finest_shared < levels.len()).then(|| Self::pools(a, plan, finest_shared)).transpose()?;
        let mut pools = pools.unwrap_or_default();
        // Every second level shares a buffer: a next guide is computed from the one before it.
        let next_guides = |first: usize| {
            let levels = (first..levels.len()).step_by(2).map(|z| Data::NextGuide(z).array(plan).bytes() / 4);
            levels.sum()
        };
        let mut next_guides =
            [a.buffer("next guide", next_guides(2))?, a.buffer("next guide", next_guides(1))?].map(Pool::new);
        for z in (0..levels.len()).rev() {
            let parts = Parts::of(a.device, plan, z)?;
            let there = |data: &Data| data.is_there(plan);
            for (kind, data) in Data::of_levels(z).into_iter().enumerate() {
                let array = data.array(plan);
                let rows = match pools.get_mut(kind) {
                    Some(pool) if z >= finest_shared => pool.rows(array.words as u32, array.rows as u32),
                    _ if there(&data) => parts.rows(a, data, &array)?,
                    _ => continue,
                };
                if there(&data) {
                    arrays.insert((array.name, z), (array, rows));
                }
            }
            for data in Data::of_level(z).into_iter().filter(there) {
                let array = data.array(plan);
                let rows = match data {
                    Data::NextGuide(_) => next_guides[z % 2].rows(array.words as u32, array.rows as u32),
                    Data::FullWindows(_) => {
                        Rows::of(a.constant("full label windows", &data.constant(plan))?, array.words as u32)
                    }
                    _ => parts.rows(a, data, &array)?,
                };
                arrays.insert((array.name, z), (array, rows));
            }
        }
        if plan.shares {
            // Post-processing reads no volumes but costs. Levels share buffers, and so do parts of a ring.
            let volumes = (0..levels.len()).flat_map(Data::of_levels).filter(|data| data.volume().is_some());
            let volumes = volumes.filter_map(|data| arrays.get(&(data.array(plan).name, data.level()?)));
            for buffer in volumes.flat_map(|(_, rows)| rows.buffers()) {
                if !a.spare.contains(buffer) {
                    a.spare.push(buffer.clone());
                }
            }
        }
        for data in Data::arrays_of_match(plan).into_iter().filter(|data| *data != Data::Groups) {
            let array = data.array(plan);
            let rows = match array.place {
                Place::In(other) => arrays[&(other.array(plan).name, 0)].1.with_words(array.words as u32),
                _ if array.start == Start::Constant => {
                    let words = data.constant(plan);
                    Rows::of(a.constant(array.name, &words)?, words.len() as u32)
                }
                _ => Self::rows_of_match(a, plan, &array)?,
            };
            arrays.insert((array.name, 0), (array, rows));
        }
        let zeroed = Data::all(plan).into_iter().filter(|data| data.array(plan).start == Start::Zero);
        Ok(Self {
            finest_shared,
            levels,
            elsewhere: Self::elsewhere(plan, &arrays),
            arrays,
            exchanged: Exchanged::default(),
            nothing: a.buffer("nothing", 0)?,
            groups: a.buffer("groups", 0)?,
            all_groups: a.constant("groups", &[])?,
            endings: 0,
            zeroed: zeroed.collect(),
            written: allocator.written,
            constant: allocator.constant,
        })
    }

    /// Allocates an array that belongs to no level. A band gets at most as many rows as the device can bind.
    fn rows_of_match(a: &mut Allocator, plan: &Plan, array: &Array) -> Result<Rows> {
        let (words, mut rows) = (array.words as u32, array.rows as u64);
        if array.of_band && array.place == Place::AnyVolume {
            let most = a.device.max_binding.min(a.device.max_buffer);
            rows = rows.min(most / (4 * u64::from(words)));
            if rows == 0 {
                return Err(a.device.too_large(ONE_ROW, 4 * u64::from(words), most));
            }
        }
        let height = if array.of_band { rows } else { array.extent.rows(plan) as u64 };
        Rows::in_parts(words, &[0, height as u32], |_, rows| match array.place {
            Place::AnyVolume => a.spare_or_new(array.name, u64::from(words) * rows),
            _ => a.buffer(array.name, u64::from(words) * rows),
        })
    }

    /// The finest level that shares buffers with all coarser ones: as many levels as fit in a binding.
    pub(super) fn finest_shared(device: &Device, plan: &Plan) -> usize {
        let most = device.max_binding.min(device.max_buffer);
        // A level with a ring of rows does not share.
        let first = usize::from(!plan.holds_all_rows());
        let mut sizes = Data::of_levels(0).map(|_| 0);
        let mut finest = plan.levels.len();
        while finest > first {
            let here = Data::of_levels(finest - 1);
            sizes = array::from_fn(|kind| sizes[kind] + here[kind].array(plan).bytes());
            if sizes.iter().any(|&bytes| bytes > most) {
                break;
            }
            finest -= 1;
        }
        finest
    }

    /// The buffers that the levels from `finest` on share.
    fn pools(a: &mut Allocator, plan: &Plan, finest: usize) -> Result<Vec<Pool>> {
        let kinds = 0..Data::of_levels(0).len();
        let pools = kinds.map(|kind| {
            let all = (finest..plan.levels.len()).map(|z| Data::of_levels(z)[kind]);
            // A level begins at one place in all volumes, so that there is room for messages that the coarsest level does not have.
            let all: Vec<_> = all.filter(|data| *data != Data::Volume(Volume::Up(0))).collect();
            let arrays: Vec<_> = all.iter().map(|data| data.array(plan)).collect();
            let name = arrays.last().map_or("nothing", |array| array.name);
            Ok(Pool::new(a.buffer(name, arrays.iter().map(|array| array.bytes() / 4).sum())?))
        });
        pools.collect()
    }

    /// See [`Self::elsewhere`]: maps move into the memory of their successors, and successors, with what is placed in them, into
    /// the memory of the maps.
    fn elsewhere(
        plan: &Plan,
        arrays: &HashMap<(&'static str, usize), (Array, Rows)>,
    ) -> HashMap<&'static str, (usize, Rows)> {
        let rows = |data: Data| arrays.get(&(data.array(plan).name, 0)).map(|(_, rows)| rows);
        let mut elsewhere = HashMap::new();
        for (at, (map, next)) in SUCCESSORS.into_iter().enumerate() {
            let (Some(of_map), Some(of_next)) = (rows(Data::Map(map)), rows(next)) else { continue };
            elsewhere.insert(Data::Map(map).array(plan).name, (at, of_next.clone()));
            let next_name = next.array(plan).name;
            let moves = |array: &Array| array.name == next_name || array.place == Place::In(next);
            let moving = arrays.values().filter(|(array, _)| moves(array));
            elsewhere
                .extend(moving.map(|(array, _)| (array.name, (at, of_map.with_words(array.words as u32)))));
        }
        elsewhere
    }

    /// The array at a place of [`Self::arrays`] while `exchanged`.
    fn at(&self, place: (&'static str, usize), exchanged: Exchanged) -> Option<(&Array, &Rows)> {
        let (array, rows) = self.arrays.get(&place)?;
        let elsewhere = self.elsewhere.get(array.name).filter(|(at, _)| exchanged.0[*at]);
        Some((array, elsewhere.map_or(rows, |(_, rows)| rows)))
    }

    /// The array that is bound as `name` at `level` while `exchanged`, if it exists; see [`Data::bound`].
    pub(super) fn named(
        &self,
        name: &'static str,
        level: usize,
        exchanged: Exchanged,
    ) -> Option<(&Array, &Rows)> {
        self.at(Data::place_of(name, level), exchanged)
    }

    /// The array of `data`, which must exist, while `exchanged`.
    pub(super) fn rows_while(&self, plan: &Plan, data: Data, exchanged: Exchanged) -> &Rows {
        let place = (data.array(plan).name, data.level().unwrap_or(0));
        self.at(place, exchanged).expect("the plan has the array").1
    }

    /// The array of `data`, which must exist, as of now.
    pub(super) fn rows(&self, plan: &Plan, data: Data) -> &Rows {
        self.rows_while(plan, data, self.exchanged)
    }

    /// The array of `volume`, which must exist.
    pub(super) fn volume(&self, plan: &Plan, volume: Volume) -> &Rows {
        self.rows(plan, Data::Volume(volume))
    }

    /// The array of `map`, which must exist.
    pub(super) fn map(&self, plan: &Plan, map: Map) -> &Rows {
        self.rows(plan, Data::Map(map))
    }

    /// A binding in place of a missing array.
    pub(super) fn nothing(&self) -> Binding {
        Binding::whole(&self.nothing)
    }

    /// The parameters of level `z` in shared buffers, and the offsets of its volumes and its dependency messages there, in quads.
    pub(super) fn shared_params(&self, plan: &Plan, z: usize) -> (LevelParams, (u32, u32)) {
        let quad = 4 * plan.volume_width.bytes() as u64;
        let start = |data: Data, bytes: u64| self.rows(plan, data).start(bytes);
        let params = LevelParams {
            members_at: start(Data::Members(z), 4),
            incoming_at: start(Data::Incoming(z), 8),
            windows_at: start(Data::Windows(z), 4),
            ..self.levels[z]
        };
        let [belief, dependency] = [Volume::Belief(z), Volume::Dependency(z)].map(Data::Volume);
        (params, (start(belief, quad), start(dependency, quad)))
    }

    /// Allocates the workgroup counts of the dispatches that end once the map has settled.
    pub(super) fn end_when_settled(
        &mut self,
        device: &mut Device,
        plan: &Plan,
        groups: &[[u32; 3]],
    ) -> Result<()> {
        let usage = wgpu::BufferUsages::INDIRECT | USAGE;
        let words = groups.as_flattened();
        let mut allocator = Allocator::new(device);
        self.all_groups = allocator.constant("groups", words)?;
        self.groups = allocator.allocate("groups", words.len() as u64, usage)?;
        self.written.push(self.groups.clone());
        self.constant.append(&mut allocator.constant);
        self.endings = groups.len() as u32;
        let array = Array { words: words.len().max(ALIGN_WORDS), ..Data::Groups.array(plan) };
        self.arrays.insert((array.name, 0), (array, Rows::of(self.groups.clone(), array.words as u32)));
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
