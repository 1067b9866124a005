// The label map of level 0 and its change: `labels`, then `sums`, then `settle`.

#import band volume messages

struct Params {
    level: Level,
    @align(16) band: Band,
    // Upper bound of a settled sum, lower and upper half, and whether it is used.
    most_low: u32,
    most_high: u32,
    may_settle: u32,
    // Number of dispatches that end once the map has settled.
    endings: u32,
}

struct Convergence {
    // The last sum, lower and upper half.
    sum: vec2<u32>,
    // Number of runs.
    runs: u32,
    settled: u32,
    // Number of runs after it had settled.
    idle: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

@group(0) @binding(1) var<storage, read> belief: array<Quad>;
@group(0) @binding(2) var<storage, read_write> label_map: array<u32>;
@group(0) @binding(3) var<storage, read_write> squares: array<u32>;
// Lower and upper half of the sum of each row.
@group(0) @binding(4) var<storage, read_write> row_sums: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> convergence: Convergence;
// Workgroup counts of the dispatches, in x, y and z.
@group(0) @binding(6) var<storage, read_write> groups: array<u32>;

// The label map, and the squared difference of each pixel from the previous map. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn labels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let first = id.y * params.level.pitch;
    var least = vec4(0xffffffffu);
    for (var quad = 0u; quad < params.level.quads; quad++) {
        // Belief and label in one key; the beliefs of padding are above all others.
        least = min(least, (unpack(belief[first + place_of(quad, id.x)]) << vec4(16u)) | labels_of(quad));
    }
    let label = smallest(least) & 0xffffu;
    let pixel = id.y * params.level.pixel_pitch + id.x;
    let difference = abs(i32(label) - i32(label_map[pixel]));
    label_map[pixel] = label;
    squares[pixel] = u32(difference * difference);
}

// Sums the squared differences of each row, in 64 bits. One invocation per row.
@compute @workgroup_size(GROUP)
fn sums(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.band.rows || id.y > 0u {
        return;
    }
    var sum = vec2<u32>();
    for (var x = 0u; x < params.level.width; x++) {
        let low = sum.x + squares[id.x * params.level.pixel_pitch + x];
        sum = vec2(low, sum.y + u32(low < sum.x));
    }
    row_sums[params.band.first_row + id.x] = sum;
}

// Sums all rows, and ends message passing once the sum is small. One invocation.
@compute @workgroup_size(GROUP)
fn settle(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x > 0u || id.y > 0u {
        return;
    }
    if convergence.settled != 0u {
        convergence.idle += 1u;
        return;
    }
    var sum = vec2<u32>();
    for (var y = 0u; y < params.level.height; y++) {
        let low = sum.x + row_sums[y].x;
        sum = vec2(low, sum.y + row_sums[y].y + u32(low < sum.x));
    }
    let is_small = sum.y < params.most_high || (sum.y == params.most_high && sum.x <= params.most_low);
    if params.may_settle == 1u && convergence.runs > 0u && is_small {
        convergence.settled = 1u;
        for (var i = 0u; i < params.endings; i++) {
            groups[3u * i] = 0u;
        }
    }
    convergence.sum = sum;
    convergence.runs += 1u;
}
