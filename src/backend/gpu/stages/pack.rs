//! Packs the maps for reading back, in 6 bytes per pixel instead of 12; see [`Plan::packs_maps`](crate::plan::Plan::packs_maps).

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::error::Result;
use crate::maps::FRACTION;
use crate::stage::{Data, Map};

shader! {
    "pack"(plan, level) { pairs: u32, pitch: u32, raw_pitch: u32, low: i32 }
    own { disparity, flags, raw, packed_maps, packed_raw } if plan.packs_maps() && plan.full.is_none() => {
        Variant::new(0)
    };
    full {
        disparity as full_disparity, flags as full_flags, raw as full_raw, packed_maps as full_packed_maps,
        packed_raw as full_packed_raw
    } if plan.packs_maps() && plan.full.is_some() => Variant::new(0);
}

/// Packs the final maps.
pub(super) fn record(r: &mut Recorder) -> Result<()> {
    let plan = r.plan;
    let pitch = |data: Data| data.array(plan).words as u32;
    let (kernel, map, raw) = if plan.full.is_some() {
        (full(plan, 0), Map::FullDisparity, Data::FullPackedRaw)
    } else {
        (own(plan, 0), Map::Disparity, Data::PackedRaw)
    };
    let uniform = Uniform {
        pairs: map.size(plan).0.div_ceil(2) as u32,
        pitch: pitch(Data::Map(map)),
        raw_pitch: pitch(raw),
        low: FRACTION * plan.of_pair().range.min,
    };
    r.rows(&kernel, &uniform, uniform.pairs)
}
