// Exchanges and mirrors the views. One invocation per pixel of the left half and its mirror image; `full` is
// for the full-size views, which have twice as many rows.

#import band

struct Params {
    level: Level,
    @align(16) band: Band,
    // Elements per full-size row.
    full_pitch: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> right: array<vec4<u32>>;
// label | best << 16, runner-up.
@group(0) @binding(3) var<storage, read_write> optima: array<vec2<u32>>;
// label | best << 16.
@group(0) @binding(4) var<storage, read_write> right_labels: array<u32>;
@group(0) @binding(5) var<storage, read_write> full_left: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> full_right: array<vec2<u32>>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= (width + 1u) / 2u || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    let a = row + id.x;
    let b = row + width - 1u - id.x;
    let lefts = array(left[a], left[b]);
    left[a] = right[b];
    left[b] = right[a];
    right[a] = lefts[1];
    right[b] = lefts[0];
    let labels = vec2(optima[a].x, optima[b].x);
    let right_a = right_labels[a];
    let right_b = right_labels[b];
    optima[a] = vec2(right_b, NO_RUNNER_UP);
    optima[b] = vec2(right_a, NO_RUNNER_UP);
    right_labels[a] = labels.y;
    right_labels[b] = labels.x;
}

@compute @workgroup_size(GROUP)
fn full(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= 2u * width || id.y >= params.band.rows {
        return;
    }
    let j = id.x / width;
    let x = id.x - j * width;
    let row = (2u * id.y + j) * params.full_pitch;
    let a = row + x;
    let b = row + 2u * width - 1u - x;
    let lefts = array(full_left[a], full_left[b]);
    full_left[a] = full_right[b];
    full_left[b] = full_right[a];
    full_right[a] = lefts[1];
    full_right[b] = lefts[0];
}
