// Cost of a level from the next finer one: a low-pass in x and y, then a low-pass or minimum over
// disparities. One invocation per coarse pixel and pair of coarse labels, which share the fine labels between
// them.

#import band volume

struct Params {
    level: Level,
    @align(16) band: Band,
    @align(16) fine: Level,
    // Twice the smallest label of the level minus the finer level's smallest label: 0 or -1.
    label_offset: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
// 8-bit at level 0, 16-bit at coarser levels.
@group(0) @binding(1) var<storage, read> fine_cost: array<u32>;
@group(0) @binding(2) var<storage, read_write> cost: array<u32>;

// The binomial mean over x and y of the fine cost around (2 x, 2 y), at the fine label `index`, clamped.
fn smooth_cost(x: i32, y: i32, index: i32) -> u32 {
    let label = u32(clamp(index, 0, i32(params.fine.labels) - 1));
    let top = max(2 * params.band.first_row, 2u) - 2u;
    let words = select(2u, 1u, FINE_NARROW);
    let pitch = params.fine.pitch * words;
    var sum = 128u;
    for (var j = 0; j < 5; j++) {
        let v = u32(clamp(2 * y + j - 2, 0, i32(params.fine.height) - 1)) - top;
        for (var i = 0; i < 5; i++) {
            let u = u32(clamp(2 * x + i - 2, 0, i32(params.fine.width) - 1));
            let quad = v * pitch + words * (label / 4u * params.fine.width + u);
            var c: u32;
            if FINE_NARROW {
                c = ((fine_cost[quad] >> (8u * (label % 4u))) & 0xffu) << 8u;
            } else {
                c = (fine_cost[quad + label % 4u / 2u] >> (16u * (label % 2u))) & 0xffffu;
            }
            sum += WEIGHTS[i] * WEIGHTS[j] * c;
        }
    }
    return sum >> 8u;
}

var<private> WEIGHTS: array<u32, 5> = array(1u, 4u, 6u, 4u, 1u);

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let quad = id.x / 2u / params.level.width;
    let x = id.x / 2u - quad * params.level.width;
    if quad >= params.level.quads || id.y >= params.band.rows {
        return;
    }
    let y = params.band.first_row + id.y;
    // Smoothed costs at the fine labels from two below the first coarse label to two above the second.
    let base = i32(8u * quad + 4u * (id.x % 2u)) + params.label_offset - 2;
    var s: array<u32, 7>;
    for (var i = 0; i < 7; i++) {
        if LOW_PASS || (i >= 1 && i <= 5) {
            s[i] = smooth_cost(i32(x), i32(y), base + i);
        }
    }
    var costs: vec2<u32>;
    if LOW_PASS {
        costs.x = (s[0] + 4u * s[1] + 6u * s[2] + 4u * s[3] + s[4] + 8u) >> 4u;
        costs.y = (s[2] + 4u * s[3] + 6u * s[4] + 4u * s[5] + s[6] + 8u) >> 4u;
    } else {
        costs.x = min(min(s[1], s[2]), s[3]);
        costs.y = min(min(s[3], s[4]), s[5]);
    }
    cost[2u * id.y * params.level.pitch + id.x] = costs.x | (costs.y << 16u);
}
