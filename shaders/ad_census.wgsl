// Matching cost of level 0 by colour difference and census. One invocation a pixel and quad of labels.

@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> right: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> left_census: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> right_census: array<vec2<u32>>;
// The cost of a colour difference, then from AD_ENTRIES on that of a census difference.
@group(0) @binding(5) var<storage, read> tables: array<u32>;
@group(0) @binding(6) var<storage, read_write> cost: array<u32>;

const AD_ENTRIES: u32 = 768u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    let x = id.x / params.level.quads;
    let quad = id.x - x * params.level.quads;
    if x >= width || id.y >= params.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    let pixel = left[row + x];
    let bits = left_census[row + x];
    var costs = vec4<u32>();
    for (var i = 0u; i < 4u; i++) {
        let xr = i32(x) - params.level.low - i32(4u * quad + i);
        var c = params.outside_cost;
        if xr >= 0 && xr < i32(width) {
            let other = right[row + u32(xr)];
            if (pixel.z | other.z) == 0u {
                let ones = countOneBits(bits ^ right_census[row + u32(xr)]);
                c = tables[colour_difference(pixel, other) >> 8u] + tables[AD_ENTRIES + ones.x + ones.y];
            }
        }
        costs[i] = c;
    }
    cost[id.y * params.level.pitch + id.x] = pack_narrow(costs);
}
