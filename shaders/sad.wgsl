// Matching cost of level 0 by the mean colour difference over a window. One invocation for RUN pixels of a row and a
// quad of labels: a column of the window serves all of them.

@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> right: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> cost: array<u32>;

const RUN: i32 = 8;
const COST_MAX: u32 = 254u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = i32(params.level.width);
    let runs = u32((width + RUN - 1) / RUN);
    let quad = id.x / runs;
    let x0 = i32(id.x - quad * runs) * RUN;
    if quad >= params.level.quads || id.y >= params.rows {
        return;
    }
    let pitch = i32(params.level.pixel_pitch);
    let radius = params.sad_radius;
    let top = i32(halo_start(u32(radius)));
    let y = i32(params.first_row + id.y);
    let y_first = max(y - radius, 0);
    let y_last = min(y + radius, i32(params.level.height) - 1);
    let shifts = vec4(params.level.low + i32(4u * quad)) + vec4(0, 1, 2, 3);
    var sums: array<vec4<u32>, RUN>;
    var counts: array<vec4<u32>, RUN>;
    for (var x = max(x0 - radius, 0); x <= min(x0 + RUN - 1 + radius, width - 1); x++) {
        var sum = vec4<u32>();
        var count = vec4<u32>();
        for (var v = y_first; v <= y_last; v++) {
            let row = (v - top) * pitch;
            let pixel = left[row + x];
            for (var i = 0; i < 4; i++) {
                let xr = x - shifts[i];
                if xr >= 0 && xr < width {
                    let other = right[row + xr];
                    if (pixel.z | other.z) == 0u {
                        sum[i] += difference(channels(pixel), channels(other));
                        count[i] += 1u;
                    }
                }
            }
        }
        for (var i = 0; i < RUN; i++) {
            if abs(x - (x0 + i)) <= radius {
                sums[i] += sum;
                counts[i] += count;
            }
        }
    }
    for (var i = 0; i < RUN; i++) {
        let x = x0 + i;
        if x < width {
            let pixel = left[(y - top) * pitch + x];
            var costs = vec4<u32>();
            for (var j = 0; j < 4; j++) {
                let xr = x - shifts[j];
                var c = params.outside_cost;
                if xr >= 0 && xr < width {
                    if (pixel.z | right[(y - top) * pitch + xr].z) == 0u {
                        let n = counts[i][j];
                        c = min((sums[i][j] + 384u * n) / (768u * n), COST_MAX);
                    }
                }
                costs[j] = c;
            }
            cost[id.y * params.level.pitch + place_of(quad, u32(x))] = pack_narrow(costs);
        }
    }
}
