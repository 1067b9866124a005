// Takes a pixel's own guess off the lead of its label. One invocation per pixel.

#import band volume windows messages prior

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> belief: array<Quad>;
// label | best << 16, runner-up.
@group(0) @binding(2) var<storage, read_write> optima: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> windows: array<u32>;
@group(0) @binding(4) var<storage, read> prior: array<vec2<u32>>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let known = prior[at];
    let cap = prior_cap(known);
    if cap == 0u || cap > GUESS_CAP {
        return;
    }
    let row = id.y * params.level.pitch;
    let window = window_of(id.x, params.band.first_row + id.y);
    let own = quads_of(window);
    let label = optima[at].x & 0xffffu;
    // Sums are larger by the cap, so that none is negative.
    var least = vec4(NO_RUNNER_UP);
    for (var quad = own.x; quad < own.y; quad++) {
        let labels = labels_of(quad);
        let sum = unpack(belief[row + place_of(quad, id.x)]) + vec4(cap) - prior_cost(known, quad);
        let away = abs(vec4<i32>(labels) - vec4(i32(label))) > vec4(1);
        least = min(least, select(vec4(NO_RUNNER_UP), sum, are_in(window, quad) & away));
    }
    let other = smallest(least);
    if other < NO_RUNNER_UP {
        let own_cost = prior_cost(known, label / 4u)[label % 4u];
        let sum = max(other + own_cost, cap) - cap;
        optima[at].y = max(sum, optima[at].x >> 16u);
    }
}
