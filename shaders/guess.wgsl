// Takes what was filled in as a weak prior for the next look: at level 0 from the maps, at the other levels from the next finer one.
// One invocation per pixel. A prior is: first label without a cost | slope << 20, last label without a cost | cap << 20.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
    @align(16) fine: Level,
    // Twice the smallest label of the level minus the finer level's smallest label: 0 or -1.
    label_offset: i32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> disparity: array<i32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> prior: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> fine_prior: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read_write> coarse_prior: array<vec2<u32>>;

// An end of an interval as it is stored, cut to a label outside those of the level.
fn stored(end: i32) -> u32 {
    let most = i32(params.level.labels << PRIOR_LABEL_BITS);
    let label = i32(1u << PRIOR_LABEL_BITS);
    return u32(clamp(end, -label, most) + label);
}

// The guess at element `at` of the maps.
fn guess_of(at: u32) -> vec2<u32> {
    if !is_filled(flags[at]) {
        return vec2(0u);
    }
    let end = stored((disparity[at] - FRACTION * params.level.low) >> (8u - PRIOR_LABEL_BITS));
    return vec2(end | (GUESS_SLOPE << 20u), end | (GUESS_CAP << 20u));
}

@compute @workgroup_size(GROUP)
fn take(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    prior[at] = guess_of(at);
}

// Takes the guess where no prior of the caller is known, which has a larger cap.
@compute @workgroup_size(GROUP)
fn take_unknown(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    if (prior[at].y >> 20u) <= GUESS_CAP {
        prior[at] = guess_of(at);
    }
}

@compute @workgroup_size(GROUP)
fn pool(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    var low = 0xfffffu;
    var high = 0u;
    var slope = 0u;
    var cap = 0u;
    var count = 0u;
    for (var i = 0u; i < 4u; i++) {
        let u = 2u * id.x + (i & 1u);
        let v = 2u * id.y + (i >> 1u);
        if u >= params.fine.width || 2u * params.band.first_row + v >= params.fine.height {
            continue;
        }
        let child = fine_prior[v * params.fine.pixel_pitch + u];
        if (child.y >> 20u) == 0u {
            continue;
        }
        low = min(low, child.x & 0xfffffu);
        high = max(high, child.y & 0xfffffu);
        slope += child.x >> 20u;
        let own = child.y >> 20u;
        cap += select(own, max(own, GUESS_FADE) - GUESS_FADE, own <= GUESS_CAP);
        count += 1u;
    }
    var pooled = vec2(0u);
    if count > 0u {
        let label = i32(1u << PRIOR_LABEL_BITS);
        let shift = label * params.label_offset;
        // Stored ends are a label larger.
        let first = stored((i32(low) - shift - 2 * label) >> 1u);
        let last = stored((i32(high) - shift + 1) >> 1u);
        pooled = vec2(
            first | (min(2u * slope / count, PRIOR_SLOPE_MOST) << 20u),
            last | ((cap / count) << 20u),
        );
    }
    coarse_prior[id.y * params.level.pixel_pitch + id.x] = pooled;
}
