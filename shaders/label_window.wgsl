// Label windows as first label | number of labels with padding << 16: `within` label ranges, or `around` the
// `candidates` of the next coarser level.

#import band volume windows messages

struct Params {
    level: Level,
    @align(16) band: Band,
    // Windows per row, and labels of their level without and with padding.
    runs: u32,
    labels: u32,
    stride: u32,
    // The label of this level that agrees best with label 0 of the next coarser one: 0 or -1.
    label_offset: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> belief: array<Quad>;
// Candidates of each pixel of the coarser level, lowest | highest << 16.
@group(0) @binding(2) var<storage, read_write> candidates_out: array<u32>;
@group(0) @binding(3) var<storage, read> candidates_in: array<u32>;
// First and last label of each pixel, first | last << 16.
@group(0) @binding(4) var<storage, read> label_range: array<u32>;
@group(0) @binding(5) var<storage, read_write> windows_out: array<u32>;
// Windows of the coarser level.
@group(0) @binding(6) var<storage, read> windows: array<u32>;

// The window that contains the labels from `least` to `most`.
fn holding(least: i32, most: i32) -> u32 {
    let last = i32(params.labels) - 1;
    let first = u32(clamp(least, 0, last)) / WINDOW_STEP * WINDOW_STEP;
    let needed = u32(clamp(most, 0, last)) + 1u - first;
    let count = (needed + LABEL_BLOCK - 1u) / LABEL_BLOCK * LABEL_BLOCK;
    return min(first, params.stride - count) | (count << 16u);
}

// One invocation per coarse pixel.
@compute @workgroup_size(GROUP)
fn candidates(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pitch;
    let own = quads_of(window_of(id.x, params.band.first_row + id.y));
    var least = vec4(MOST);
    for (var quad = own.x; quad < own.y; quad++) {
        least = min(least, unpack(belief[row + place_of(quad, id.x)]));
    }
    // Labels that the pixel does not have are infinite.
    let end = vec4(min(smallest(least) + SLACK + 1u, MOST));
    var lowest = vec4(0xffffu);
    var highest = vec4(0u);
    for (var quad = own.x; quad < own.y; quad++) {
        let near = unpack(belief[row + place_of(quad, id.x)]) < end;
        lowest = min(lowest, select(vec4(0xffffu), labels_of(quad), near));
        highest = max(highest, select(vec4(0u), labels_of(quad), near));
    }
    let last = max(max(highest.x, highest.y), max(highest.z, highest.w));
    candidates_out[id.y * params.level.pixel_pitch + id.x] = smallest(lowest) | (last << 16u);
}

// One invocation per window; rows of windows are rows of the coarser level.
@compute @workgroup_size(GROUP)
fn around(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.runs || id.y >= params.band.rows {
        return;
    }
    let y = params.band.first_row + id.y;
    let top = halo_start(REACH);
    let x = id.x * (WINDOW_RUN / 2u);
    let start = vec2(max(x, REACH), max(y, REACH)) - vec2(REACH);
    let end = min(vec2(x + WINDOW_RUN / 2u, y + 1u) + vec2(REACH), vec2(params.level.width, params.level.height));
    var least = 0xffffffffu;
    var most = 0u;
    for (var v = start.y; v < end.y; v++) {
        for (var u = start.x; u < end.x; u++) {
            let candidates = candidates_in[(v - top) * params.level.pixel_pitch + u];
            least = min(least, candidates & 0xffffu);
            most = max(most, candidates >> 16u);
        }
    }
    let needed = 2 * vec2(i32(least), i32(most)) + vec2(params.label_offset);
    windows_out[y * params.runs + id.x] = holding(needed.x - MARGIN, needed.y + MARGIN);
}

// One invocation per window and row; every second row does nothing.
@compute @workgroup_size(GROUP)
fn within(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let y = params.band.first_row + id.y;
    if id.x >= params.runs || id.y >= params.band.rows || y % 2u == 1u {
        return;
    }
    let top = halo_start(REACH);
    let end = min(vec2(WINDOW_RUN * (id.x + 1u), y + 2u), vec2(params.level.width, params.level.height));
    var least = 0xffffu;
    var most = 0u;
    for (var v = y; v < end.y; v++) {
        for (var u = WINDOW_RUN * id.x; u < end.x; u++) {
            let range = label_range[(v - top) * params.level.pixel_pitch + u];
            least = min(least, range & 0xffffu);
            most = max(most, range >> 16u);
        }
    }
    windows_out[y / 2u * params.runs + id.x] = holding(i32(least), i32(most));
}
