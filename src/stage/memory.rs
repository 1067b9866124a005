//! What a match takes of the memory, at most.

use super::{Data, Extent, Place, Start};
use crate::plan::votes::Votes;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan, RING_PART, ROW_ALIGN};

/// So many costs of level 0 are held whole, at most, where its other volumes are not.
const MOST_COSTS: u64 = 1 << 27;

impl Plan {
    /// Parts of a ring, of `part` rows each and with a halo on either side, that hold all rows of level 0 that are needed at the
    /// same time: the first of the next part to be overwritten is that of a halo, and all before it must be done.
    #[must_use]
    pub fn ring_parts(&self, part: usize) -> usize {
        (self.held + 2 * (GRAPH_WINDOW / 2)).div_ceil(part) + 1
    }

    /// The plan by which a device with enough memory matches: with all rows held where these fit in the memory that the method
    /// may take, since that takes fewer dispatches.
    #[must_use]
    pub fn on_device(&self) -> Self {
        let whole = self.whole();
        let fits = whole.bytes() <= u64::from(self.memory) << 20;
        if fits { whole } else { self.clone() }
    }

    /// The plan by which the CPU path matches: where not all rows of level 0 are held, its costs are nevertheless, unless they are many
    /// or do not fit in the memory that the method may take. They are read three times, and to compute them takes longer.
    #[must_use]
    pub fn on_host(&self) -> Self {
        let holding = Self { holds_costs: true, ..self.clone() };
        let pays = !self.holds_all_rows() && self.levels[0].cells() <= MOST_COSTS;
        if pays && holding.bytes() <= u64::from(self.memory) << 20 { holding } else { self.clone() }
    }

    /// Largest number of bytes taken by the volumes and the graph of `level`, on the CPU path or on a device; where not all rows of
    /// level 0 are held, with its costs, or with what these are computed from.
    #[must_use]
    pub fn level_bytes(&self, level: usize) -> u64 {
        let l = &self.levels[level];
        let streamed = self.rows_held(level) < l.height;
        let halo = GRAPH_WINDOW / 2;
        // The ring of the CPU path is shorter.
        let rows = if streamed { self.ring_parts(RING_PART) * (RING_PART + 2 * halo) } else { l.height };
        let width = self.volume_width.bytes();
        let has = |is_there: bool| usize::from(is_there);
        // Cost, evidence, beliefs with the messages from above and below, and the messages of the factors.
        let cost = if level == 0 { 1 } else { 2 };
        let messages = 1 + has(level > 0);
        let labels = l.width * l.stride;
        let row =
            (cost + 1 + width * (1 + messages)) * aligned(labels) + width * aligned(self.slots() * labels);
        let costs = if !streamed {
            0
        } else if self.holds_costs {
            l.height * aligned(labels)
        } else {
            l.height * (2 * l.width + 24 * (l.width + 2 * l.stride))
        };
        // The member codes, and the transposed table with its row starts, and the guide.
        let on_host = l.width * (self.neighbours + 4 * self.slots() + 4 + 9);
        // A device needs less for these, but keeps candidates and label ranges as well.
        let of_level = Data::of_levels(level).into_iter().chain(Data::of_level(level));
        let graph = of_level.filter(|data| match data {
            // The left view counts as a map, and levels take turns with the next guide.
            Data::Volume(_) | Data::Guide(0) => false,
            Data::NextGuide(z) => *z == 1,
            data => data.is_there(self),
        });
        let (windows, maps): (Vec<_>, Vec<_>) =
            graph.map(|data| data.array(self)).partition(|array| array.extent == Extent::Table);
        let bytes = |arrays: Vec<super::Array>| arrays.iter().map(super::Array::bytes).sum::<u64>();
        (rows * row + costs) as u64 + bytes(maps).max((l.height * on_host) as u64) + bytes(windows)
    }

    /// Largest number of bytes taken by the images and all maps.
    #[must_use]
    pub fn map_bytes(&self) -> u64 {
        // The maps of the left view, and both views mirrored, while those of the right view are made.
        let right = if self.method.refinement.right_map { 10 + 2 * 9 } else { 0 };
        let (width, height) = self.size();
        // At full size: the views, their census and the maps, of four times as many pixels.
        let full = if self.full.is_some() { 4 * (2 * 9 + 2 * 4 + 16) + 16 } else { 0 };
        // What a device keeps beside them, with its tables.
        let is_map = |data: &Data| {
            let array = data.array(self);
            let counted =
                matches!(array.extent, Extent::Level(_) | Extent::Table) && *data != Data::BlockCosts;
            counted && array.place == Place::Own && array.start != Start::Constant
        };
        let maps = Data::arrays_of_match(self).into_iter().chain([Data::LEFT]).filter(is_map);
        let maps: u64 = maps.map(|data| data.array(self).bytes()).sum();
        let more = (right + full) * width.next_multiple_of(ROW_ALIGN / 4) * height + (1 << 14);
        maps + more as u64 + self.vote_bytes() + self.patch_bytes()
    }

    /// Largest number of bytes taken by the votes on invalid pixels.
    fn vote_bytes(&self) -> u64 {
        if !Data::Sums.is_there(self) {
            return 0;
        }
        let votes = Votes::of(self);
        // The CPU path pads labels.
        let padded = votes.labels.next_multiple_of(LABEL_BLOCK / 2);
        let sums = aligned(4 * votes.width * padded) * (votes.band + votes.summed());
        // The half-size image and the votes, and a device's table of weights.
        (sums + 2 * aligned(4 * votes.width) * votes.height + (1 << 13)) as u64
    }

    /// Largest number of bytes taken by planes from far away: the patches, and a device's table of weights.
    fn patch_bytes(&self) -> u64 {
        if Data::Patches.is_there(self) { Data::Patches.array(self).bytes() + (1 << 11) } else { 0 }
    }

    /// Largest number of bytes that the host takes besides the pair before it hands it to a backend. Per pixel: 66 to
    /// correct the illumination (48 for one view, 18 for the corrected pair), and 200 to find texture zones
    /// (spectrum and responses).
    #[must_use]
    pub fn front_bytes(&self) -> u64 {
        let corrected = if self.method.front.corrects_illumination() { 66 } else { 0 };
        let zones = if self.limits_labels() { 200 } else { 0 };
        (corrected + zones) * self.levels[0].pixels() as u64
    }

    /// Bytes of the pair at half its size, with its full size in whole blocks, where it is matched there.
    #[must_use]
    pub fn halving_bytes(&self) -> u64 {
        if self.full.is_some() { self.pair_bytes() } else { 0 }
    }

    /// Bytes of what the conditioning of the pair leaves, another pair. While it works it takes up to three times as many, before a
    /// match holds anything else.
    #[must_use]
    pub fn conditioning_bytes(&self) -> u64 {
        let front = &self.method.front;
        let any = front.level_rows || front.equal_sharpness || front.denoise;
        if any { self.pair_bytes() } else { 0 }
    }

    /// Bytes of the pair: 18 per pixel, for two views of 8 and their masks. Where it is matched at half its size, with the full one.
    #[must_use]
    pub fn pair_bytes(&self) -> u64 {
        let full = if self.full.is_some() { 4 } else { 0 };
        (1 + full) * 18 * self.levels[0].pixels() as u64
    }

    /// Largest number of bytes taken by the maps of an image that is matched tile by tile. A pixel takes 20
    /// in the maps that the tiles write and those derived from them (label, best, runner-up, right label and
    /// its belief 2 each, raw and final disparity 4 each, validity and confidence 1 each), and 12 while they
    /// are made; 9 more where the left view is corrected.
    #[must_use]
    pub fn mosaic_bytes(&self) -> u64 {
        let corrected = if self.method.front.corrects_illumination() { 9 } else { 0 };
        // Disparities of the right view, its image and its maps.
        let right = if self.method.refinement.right_map { 4 + 2 * 9 + 12 } else { 0 };
        // The maps at full size, and a copy.
        let full = if self.full.is_some() { 4 * 2 * 10 } else { 0 };
        // The host counts votes before it carries planes.
        let filling = self.vote_bytes().max(self.patch_bytes());
        (20 + 12 + corrected + right + full) * self.levels[0].pixels() as u64 + filling
    }

    /// Bytes taken by all volumes, graphs and maps together.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.map_bytes() + (0..self.levels.len()).map(|z| self.level_bytes(z)).sum::<u64>()
    }
}

/// Bytes of a row with its padding.
fn aligned(bytes: usize) -> usize {
    bytes.next_multiple_of(ROW_ALIGN)
}
