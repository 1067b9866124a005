// Sets the costs outside a pixel's label range to the largest cost. One invocation per pixel and quad of
// labels.

#import band volume

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
// 8-bit at level 0, 16-bit at coarser levels.
@group(0) @binding(1) var<storage, read_write> cost: array<u32>;
// First and last label of each pixel, first | last << 16.
@group(0) @binding(2) var<storage, read> label_range: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let quad = id.x / params.level.width;
    let x = id.x - quad * params.level.width;
    if quad >= params.level.quads || id.y >= params.band.rows {
        return;
    }
    let ends = label_range[id.y * params.level.pixel_pitch + x];
    let labels = labels_of(quad);
    let inside = (labels >= vec4(ends & 0xffffu)) & (labels <= vec4(ends >> 16u));
    if all(inside) {
        return;
    }
    if FINE_NARROW {
        let at = id.y * params.level.pitch + id.x;
        cost[at] = pack_narrow(select(vec4(COST_MAX), unpack_narrow(cost[at]), inside));
    } else {
        let at = 2u * (id.y * params.level.pitch + id.x);
        let kept = unpack_wide(vec2(cost[at], cost[at + 1u]));
        let words = pack_wide(select(vec4(COST_MAX << COST_FRACTION_BITS), kept, inside));
        cost[at] = words.x;
        cost[at + 1u] = words.y;
    }
}
