// Beliefs: evidence plus all messages. One invocation per pixel and block of 16 labels.

#import band volume windows messages

struct Params {
    level: Level,
    @align(16) band: Band,
    // Largest belief; larger sums saturate at it.
    most: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> evidence: array<u32>;
@group(0) @binding(2) var<storage, read> dependency: array<Quad>;
// Start of each pixel's entries in the transposed table, with one more per row.
@group(0) @binding(3) var<storage, read> starts: array<u32>;
// The slots that hold a pixel: dx + 3 | (dy + 3) << 3 | slot << 6, with the factor at (dx, dy) from the
// pixel.
@group(0) @binding(4) var<storage, read> incoming: array<u32>;
@group(0) @binding(5) var<storage, read> down: array<Quad>;
@group(0) @binding(6) var<storage, read> up: array<Quad>;
@group(0) @binding(7) var<storage, read_write> belief: array<Quad>;
@group(0) @binding(8) var<storage, read> windows: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let quads = params.level.quads;
    let blocks = quads / QUADS;
    let width = params.level.width;
    let block = id.x / width;
    let x = id.x - block * width;
    let first = block * QUADS;
    if block >= blocks || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pitch;
    var sums: array<vec4<u32>, QUADS>;
    for (var i = 0u; i < QUADS; i++) {
        let at = row + place_of(first + i, x);
        sums[i] = unpack_narrow(evidence[at]);
        if HAS_DOWN {
            sums[i] += unpack(down[at]);
        }
        if HAS_UP {
            sums[i] += unpack(up[at]);
        }
    }
    let y = params.band.first_row + id.y;
    let top = halo_start(RADIUS);
    let start = id.y * params.level.starts_pitch + x;
    // Only the entries of the bound rows are bound.
    let end = starts[start + 1u] - starts[0];
    for (var e = starts[start] - starts[0]; e < end; e++) {
        let entry = incoming[e];
        let fx = x + (entry & 7u) - RADIUS;
        let fy = y + ((entry >> 3u) & 7u) - RADIUS - top;
        let message = fy * params.level.dependency_pitch + place_of((entry >> 6u) * quads + first, fx);
        for (var i = 0u; i < QUADS; i++) {
            sums[i] += unpack(dependency[message + i * width]);
        }
    }
    let window = window_of(x, y);
    for (var i = 0u; i < QUADS; i++) {
        let sum = min(sums[i], vec4(params.most));
        belief[row + place_of(first + i, x)] = pack(select(vec4(MOST), sum, are_in(window, first + i)));
    }
}
