// Matching cost of level 0 by census and colour difference. One invocation a pixel and quad of labels.

@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> right: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> left_census: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> right_census: array<vec2<u32>>;
// How much colour counts.
@group(0) @binding(5) var<storage, read> weight: array<u32>;
@group(0) @binding(6) var<storage, read_write> cost: array<u32>;

const BIT_COST: u32 = 4u;
const MOST_BITS: u32 = 40u;
const MOST_COLOUR: u32 = 64u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    let quad = id.x / width;
    let x = id.x - quad * width;
    if quad >= params.level.quads || id.y >= params.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    let pixel = left[row + x];
    let levels = channels(pixel) >> vec3(8u);
    let bits = left_census[row + x];
    let w = weight[row + x];
    var costs = vec4<u32>();
    for (var i = 0u; i < 4u; i++) {
        let xr = i32(x) - params.level.low - i32(4u * quad + i);
        var c = params.outside_cost;
        if xr >= 0 && xr < i32(width) {
            let other = right[row + u32(xr)];
            if (pixel.z | other.z) == 0u {
                let ones = countOneBits(bits ^ right_census[row + u32(xr)]);
                let colour = min(difference(levels, channels(other) >> vec3(8u)), MOST_COLOUR);
                c = BIT_COST * min(ones.x + ones.y, MOST_BITS) + (w * colour + MOST_COLOUR / 2u) / MOST_COLOUR;
            }
        }
        costs[i] = c;
    }
    cost[id.y * params.level.pitch + id.x] = pack_narrow(costs);
}
