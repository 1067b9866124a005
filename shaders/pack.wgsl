// Packs the maps for reading back: disparities as 1/256 px above the lowest one, in 16 bits. One invocation per two
// pixels of a row: `own` at the size of the level, `full` of two rows at twice its size.

#import band

struct Params {
    level: Level,
    @align(16) band: Band,
    // Pairs of pixels in a row, and elements per row of the maps and of the packed raw map.
    pairs: u32,
    pitch: u32,
    raw_pitch: u32,
    // The lowest disparity, in 1/256 px.
    low: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> disparity: array<i32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> raw: array<i32>;
// Per pixel: validity | confidence << 8 | disparity << 16.
@group(0) @binding(4) var<storage, read_write> packed_maps: array<u32>;
// Per pair of pixels: raw disparity | that of the next pixel << 16.
@group(0) @binding(5) var<storage, read_write> packed_raw: array<u32>;

// Packs two pixels of a row. Rows of an odd width have room for another pixel.
fn pack(row: u32, pair: u32) {
    let at = row * params.pitch + 2u * pair;
    packed_maps[at] = (above(disparity[at]) << 16u) | flags[at];
    packed_maps[at + 1u] = (above(disparity[at + 1u]) << 16u) | flags[at + 1u];
    packed_raw[row * params.raw_pitch + pair] = above(raw[at]) | (above(raw[at + 1u]) << 16u);
}

fn above(disparity: i32) -> u32 {
    return u32(disparity - params.low) & 0xffffu;
}

@compute @workgroup_size(GROUP)
fn own(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x < params.pairs && id.y < params.band.rows {
        pack(id.y, id.x);
    }
}

@compute @workgroup_size(GROUP)
fn full(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x < params.pairs && id.y < params.band.rows {
        pack(2u * id.y, id.x);
        pack(2u * id.y + 1u, id.x);
    }
}
