// Adds the prior to the evidence, and sets the beliefs to it. One invocation per pixel.

#import band volume windows messages prior

struct Params {
    level: Level,
    @align(16) band: Band,
    // Largest evidence of the level.
    cap: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> evidence: array<u32>;
@group(0) @binding(2) var<storage, read_write> belief: array<Quad>;
@group(0) @binding(3) var<storage, read> windows: array<u32>;
@group(0) @binding(4) var<storage, read> prior: array<vec2<u32>>;

// Evidence and prior of a quad.
fn sum_of(known: vec2<u32>, word: u32, quad: u32) -> vec4<u32> {
    return unpack_narrow(word) + prior_cost(known, quad);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let known = prior[id.y * params.level.pixel_pitch + id.x];
    if prior_cap(known) == 0u {
        return;
    }
    let row = id.y * params.level.pitch;
    let window = window_of(id.x, params.band.first_row + id.y);
    let own = quads_of(window);
    var least = vec4(1u << 16u);
    for (var quad = own.x; quad < own.y; quad++) {
        let sum = sum_of(known, evidence[row + place_of(quad, id.x)], quad);
        least = min(least, select(vec4(1u << 16u), sum, are_in(window, quad)));
    }
    let base = vec4(smallest(least));
    for (var quad = own.x; quad < own.y; quad++) {
        let index = row + place_of(quad, id.x);
        let inside = are_in(window, quad);
        let sum = max(sum_of(known, evidence[index], quad), base);
        let e = min(sum - base, vec4(params.cap));
        evidence[index] = pack_narrow(select(vec4(PADDING), e, inside));
        belief[index] = pack(select(vec4(MOST), e, inside));
    }
}
