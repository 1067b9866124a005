//! The memory of a match: upper bounds.

use super::prior::LabelPrior;
use super::{Data, Extent, Place, Start};
use crate::plan::votes::Votes;
use crate::plan::{GRAPH_WINDOW, LABEL_BLOCK, Plan, RING_PART, ROW_ALIGN};

/// Level 0 costs are held whole up to this number, even if the other volumes of level 0 are not.
const MOST_COSTS: u64 = 1 << 27;

impl Plan {
    /// Number of parts of a ring, of `part` rows and a halo on either side each, that hold all rows of level 0 in use at the
    /// same time. The first row that the next part overwrites lies in a halo; all rows before it must be done.
    #[must_use]
    pub fn ring_parts(&self, part: usize) -> usize {
        (self.held + 2 * (GRAPH_WINDOW / 2)).div_ceil(part) + 1
    }

    /// The plan for a device with enough memory: holds all rows if they fit in the memory that the method may
    /// use, since that takes fewer dispatches.
    #[must_use]
    pub fn on_device(&self) -> Self {
        let whole = self.whole();
        let fits = whole.bytes() <= u64::from(self.memory) << 20;
        if fits { whole } else { self.clone() }
    }

    /// The plan for the CPU path: if not all rows of level 0 are held, holds all costs nevertheless, unless they are too many or exceed
    /// the memory that the method may use. They are read three times, and computing them again is slower.
    #[must_use]
    pub fn on_host(&self) -> Self {
        let holding = Self { holds_costs: true, ..self.clone() };
        let pays = !self.holds_all_rows() && self.levels[0].cells() <= MOST_COSTS;
        if pays && holding.bytes() <= u64::from(self.memory) << 20 { holding } else { self.clone() }
    }

    /// Upper bound of the bytes of the volumes and the graph of `level`, on the CPU path or a device; if not
    /// all rows of level 0 are held, including its costs or the data that they are computed from.
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
        // The member codes, the transposed table with its row starts, and the guide.
        let prior = if self.has_priors() { size_of::<LabelPrior>() } else { 0 };
        let on_host = l.width * (self.neighbours + 4 * self.slots() + 4 + 9 + prior);
        // A device needs less for these, but also keeps candidates and label ranges.
        let of_level = Data::of_levels(level).into_iter().chain(Data::of_level(level));
        let graph = of_level.filter(|data| match data {
            // The left view counts as a map.
            Data::Volume(_) | Data::Guide(0) => false,
            data => data.is_there(self),
        });
        let (windows, maps): (Vec<_>, Vec<_>) =
            graph.map(|data| data.array(self)).partition(|array| array.extent == Extent::Table);
        let bytes = |arrays: Vec<super::Array>| arrays.iter().map(super::Array::bytes).sum::<u64>();
        (rows * row + costs) as u64 + bytes(maps).max((l.height * on_host) as u64) + bytes(windows)
    }

    /// Upper bound of the bytes of the images and all maps.
    #[must_use]
    pub fn map_bytes(&self) -> u64 {
        // The maps of the left view, and both views mirrored, while the right view is matched.
        let right = if self.method.refinement.right_map { 10 + 2 * 9 } else { 0 };
        let (width, height) = self.size();
        // At full size: the views, their census and the maps, with four times as many pixels.
        let full = if self.full.is_some() { 4 * (2 * 9 + 2 * 4 + 16) + 16 } else { 0 };
        // Other maps and tables of a device.
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

    /// Upper bound of the bytes of the votes on invalid pixels.
    fn vote_bytes(&self) -> u64 {
        if !Data::Sums.is_there(self) {
            return 0;
        }
        let votes = Votes::of(self);
        // The CPU path pads labels.
        let padded = votes.labels.next_multiple_of(LABEL_BLOCK / 2);
        let sums = aligned(4 * votes.width * padded) * (votes.band + votes.summed());
        // The half-size image, the votes, and a device's table of weights.
        (sums + 2 * aligned(4 * votes.width) * votes.height + (1 << 13)) as u64
    }

    /// Upper bound of the bytes of far planes: the patches, and a device's table of weights.
    fn patch_bytes(&self) -> u64 {
        if Data::Patches.is_there(self) { Data::Patches.array(self).bytes() + (1 << 11) } else { 0 }
    }

    /// Upper bound of the bytes that the host takes for preparation, besides the pair. Per pixel: 66 to
    /// correct the illumination (48 for one view, 18 for the corrected pair), and 200 to find texture zones
    /// (spectrum and responses).
    #[must_use]
    pub fn front_bytes(&self) -> u64 {
        let corrected = if self.method.front.corrects_illumination() { 66 } else { 0 };
        let zones = if self.limits_labels() { 200 } else { 0 };
        // Known disparities with their standard deviations, given and spread, and colours.
        let prior = if self.prior { 2 * 6 + 12 } else { 0 };
        (corrected + zones + prior) * self.levels[0].pixels() as u64
    }

    /// Bytes of the half-size pair with its full size in whole blocks, if the pair is matched at half size.
    #[must_use]
    pub fn halving_bytes(&self) -> u64 {
        if self.full.is_some() { self.pair_bytes() } else { 0 }
    }

    /// Bytes of the conditioned pair. Conditioning takes up to three times as many while it runs, before the
    /// match holds anything else.
    #[must_use]
    pub fn conditioning_bytes(&self) -> u64 {
        let front = &self.method.front;
        let any = front.level_rows || front.equal_sharpness || front.denoise;
        if any { self.pair_bytes() } else { 0 }
    }

    /// Bytes of the pair, 18 per pixel for two views of 8 and their masks, with the full size if matched at half of it.
    #[must_use]
    pub fn pair_bytes(&self) -> u64 {
        let full = if self.full.is_some() { 4 } else { 0 };
        (1 + full) * 18 * self.levels[0].pixels() as u64
    }

    /// Upper bound of the bytes of the maps of an image that is matched in tiles. A pixel takes 20 in the
    /// maps that the tiles write and those derived from them (label, best, runner-up, right label and its
    /// belief 2 each, raw and final disparity 4 each, validity and confidence 1 each), 12 while these are
    /// derived, and 9 more if the left view is corrected.
    #[must_use]
    pub fn mosaic_bytes(&self) -> u64 {
        let corrected = if self.method.front.corrects_illumination() { 9 } else { 0 };
        // Disparities of the right view, its image and its maps.
        let right = if self.method.refinement.right_map { 4 + 2 * 9 + 12 } else { 0 };
        // The maps at full size, and a copy.
        let full = if self.full.is_some() { 4 * 2 * 10 } else { 0 };
        // The host frees the votes before it carries planes.
        let filling = self.vote_bytes().max(self.patch_bytes());
        let anchors = if self.prior { 4 } else { 0 };
        // Disparities and validity of the last look.
        let guess = if self.looks() > 1 { 5 } else { 0 };
        (20 + 12 + corrected + right + full + anchors + guess) * self.levels[0].pixels() as u64 + filling
    }

    /// Bytes of all volumes, graphs and maps.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.map_bytes() + (0..self.levels.len()).map(|z| self.level_bytes(z)).sum::<u64>()
    }
}

/// Bytes of a row with its padding.
fn aligned(bytes: usize) -> usize {
    bytes.next_multiple_of(ROW_ALIGN)
}
