// Planes through what is measured, carried from patch to patch of 4 x 4 pixels. Twice `gather`, `carry_rows`, `rise` and `sink`, at the end `take`.

#import band image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // Patches in a row, and rows of them.
    across: u32,
    down: u32,
    // Words in a row of what patches have of their own, and of sums.
    own_pitch: u32,
    sum_pitch: u32,
    // First row of patches that is bound.
    first_bound: u32,
    // 1 where there are planes from the round before, else 0.
    again: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> disparity: array<i32>;
// By row: the moments of the patches, number by number, and then their colours, red | green << 8 | blue << 16.
@group(0) @binding(4) var<storage, read_write> own: array<i32>;
// The same without colours: what has reached a patch along its row, and then from above too.
@group(0) @binding(5) var<storage, read_write> sums: array<i32>;
// What reaches a patch from the right, and then from below; at last its plane.
@group(0) @binding(6) var<storage, read_write> back: array<i32>;
// Shares of weight that are left after a step, in 1/256, by the difference between two patches.
@group(0) @binding(7) var<storage, read> shares: array<u32>;

const NO_PLANE: i32 = 0;
const PLANE: i32 = 1;
const TRUSTED: i32 = 2;

// Weighted moments of measured pixels; their mean place counts from the middle of a patch.
struct Moments {
    weight: u32,
    mean: vec2<i32>,
    disparity: i32,
    // xx, xy, yy
    squares: vec3<i32>,
    // xd, yd
    errors: vec2<i32>,
    dd: i32,
}

// A plane: whether there is one, its value in the middle of the patch, and its slopes.
struct Plane {
    state: i32,
    value: i32,
    slopes: vec2<i32>,
}

fn own_at(x: u32, y: u32) -> u32 {
    return (y - params.first_bound) * params.own_pitch + x;
}

fn sum_at(x: u32, y: u32) -> u32 {
    return (y - params.first_bound) * params.sum_pitch + x;
}

fn own_moments(x: u32, y: u32) -> Moments {
    let at = own_at(x, y);
    let n = params.across;
    return Moments(
        u32(own[at]), vec2(own[at + n], own[at + 2u * n]), own[at + 3u * n],
        vec3(own[at + 4u * n], own[at + 5u * n], own[at + 6u * n]),
        vec2(own[at + 7u * n], own[at + 8u * n]), own[at + 9u * n],
    );
}

fn sum_moments(x: u32, y: u32) -> Moments {
    let at = sum_at(x, y);
    let n = params.across;
    return Moments(
        u32(sums[at]), vec2(sums[at + n], sums[at + 2u * n]), sums[at + 3u * n],
        vec3(sums[at + 4u * n], sums[at + 5u * n], sums[at + 6u * n]),
        vec2(sums[at + 7u * n], sums[at + 8u * n]), sums[at + 9u * n],
    );
}

fn back_moments(x: u32, y: u32) -> Moments {
    let at = sum_at(x, y);
    let n = params.across;
    return Moments(
        u32(back[at]), vec2(back[at + n], back[at + 2u * n]), back[at + 3u * n],
        vec3(back[at + 4u * n], back[at + 5u * n], back[at + 6u * n]),
        vec2(back[at + 7u * n], back[at + 8u * n]), back[at + 9u * n],
    );
}

fn set_sum(x: u32, y: u32, m: Moments) {
    let at = sum_at(x, y);
    let n = params.across;
    sums[at] = i32(m.weight);
    sums[at + n] = m.mean.x;
    sums[at + 2u * n] = m.mean.y;
    sums[at + 3u * n] = m.disparity;
    sums[at + 4u * n] = m.squares.x;
    sums[at + 5u * n] = m.squares.y;
    sums[at + 6u * n] = m.squares.z;
    sums[at + 7u * n] = m.errors.x;
    sums[at + 8u * n] = m.errors.y;
    sums[at + 9u * n] = m.dd;
}

fn set_back(x: u32, y: u32, m: Moments) {
    let at = sum_at(x, y);
    let n = params.across;
    back[at] = i32(m.weight);
    back[at + n] = m.mean.x;
    back[at + 2u * n] = m.mean.y;
    back[at + 3u * n] = m.disparity;
    back[at + 4u * n] = m.squares.x;
    back[at + 5u * n] = m.squares.y;
    back[at + 6u * n] = m.squares.z;
    back[at + 7u * n] = m.errors.x;
    back[at + 8u * n] = m.errors.y;
    back[at + 9u * n] = m.dd;
}

fn plane_of(x: u32, y: u32) -> Plane {
    let at = sum_at(x, y);
    let n = params.across;
    return Plane(back[at], back[at + n], vec2(back[at + 2u * n], back[at + 3u * n]));
}

// How far a pixel is from the middle of its patch, in half pixels.
fn from_middle(pixel: vec2<u32>) -> vec2<i32> {
    return 2 * vec2<i32>(pixel % vec2(PATCH)) - vec2(i32(PATCH) - 1);
}

// The value of a plane at a pixel of its patch, in 1/256 px.
fn value_at(plane: Plane, pixel: vec2<u32>) -> i32 {
    let up = (plane.slopes * from_middle(pixel)) >> vec2(4u);
    return (plane.value + up.x + up.y + 2) >> 2u;
}

// What a patch has of its own. One invocation per patch.
@compute @workgroup_size(GROUP)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.across || id.y >= params.band.rows {
        return;
    }
    let patch_row = params.band.first_row + id.y;
    let top = PATCH * params.band.first_row;
    let first = PATCH * vec2(id.x, patch_row);
    let end = min(first + vec2(PATCH), vec2(params.level.width, params.level.height));
    var plane = Plane(NO_PLANE, 0, vec2(0));
    if params.again == 1u {
        plane = plane_of(id.x, patch_row);
    }
    var red_green_blue = vec3(0u);
    var count = 0u;
    var reference = 0;
    var s = 0;
    var to = vec2(0);
    var error = 0;
    var squares = vec3(0);
    var errors = vec2(0);
    var spread = 0;
    for (var v = first.y; v < end.y; v++) {
        for (var u = first.x; u < end.x; u++) {
            let at = (v - top) * params.level.pixel_pitch + u;
            if left[at].z == 0u {
                red_green_blue += channels(left[at]) >> vec3(8u);
                count++;
            }
            var w = i32((flags[at] >> 8u) & 0xffu);
            if !is_valid(flags[at]) {
                w = 0;
            } else if plane.state != NO_PLANE {
                let near = (1 << FAR_BITS) - abs(disparity[at] - value_at(plane, vec2(u, v)));
                w = (w * max(near, 0)) >> FAR_BITS;
            }
            if w > 0 {
                if s == 0 {
                    reference = disparity[at];
                }
                let e = clamp((disparity[at] - reference) >> 4u, -SPREAD, SPREAD);
                let away = from_middle(vec2(u, v));
                s += w;
                to += w * away;
                error += w * e;
                squares += w * vec3(away.x * away.x, away.x * away.y, away.y * away.y);
                errors += w * e * away;
                spread += w * e * e;
            }
        }
    }
    let at = own_at(id.x, patch_row);
    let n = params.across;
    let all = max(s, 1);
    let e = error / all;
    own[at] = i32((u32(s) + ((1u << WEIGHT_BITS) >> 1u)) >> WEIGHT_BITS);
    own[at + n] = 512 * to.x / all;
    own[at + 2u * n] = 512 * to.y / all;
    own[at + 3u * n] = 4 * reference + 64 * error / all;
    own[at + 4u * n] = (squares.x - to.x * to.x / all) / all;
    own[at + 5u * n] = (squares.y - to.x * to.y / all) / all;
    own[at + 6u * n] = (squares.z - to.y * to.y / all) / all;
    own[at + 7u * n] = (errors.x - to.x * e) / (2 * all);
    own[at + 8u * n] = (errors.y - to.y * e) / (2 * all);
    own[at + 9u * n] = (spread - error * e) / all;
    let mean = (2u * red_green_blue + vec3(count)) / vec3(max(2u * count, 1u));
    own[at + 10u * n] = i32(mean.x | (mean.y << 8u) | (mean.z << 16u));
}

// Share of the weight that is left after the step between two patches, in 1/256.
fn share_between(a: vec2<u32>, b: vec2<u32>) -> u32 {
    let one = own_at(a.x, a.y);
    let other = own_at(b.x, b.y);
    let n = params.across;
    let colours = vec2(u32(own[one + 10u * n]), u32(own[other + 10u * n]));
    let shifts = vec3(0u, 8u, 16u);
    var apart = difference((vec3(colours.x) >> shifts) & vec3(255u), (vec3(colours.y) >> shifts) & vec3(255u));
    if own[one] > 0 && own[other] > 0 {
        apart += u32(max(abs(own[one + 3u * n] - own[other + 3u * n]) - STEP, 0)) >> STEP_BITS;
    }
    return shares[min(apart, LAST_SHARE)];
}

// Moments as seen from a patch that is `step` patches away, where `share` / 256 of their weight is left.
fn carried(m: Moments, step: vec2<i32>, share: u32) -> Moments {
    var out = m;
    out.mean = clamp(m.mean - 1024 * i32(PATCH) * step, vec2(-REACH), vec2(REACH));
    out.weight = (m.weight * share) >> 8u;
    return out;
}

// One moment of two sets together, from those of each and what is between them.
fn moment(a: i32, b: i32, share: i32, between: i32) -> i32 {
    return clamp(a + (((b - a) * share + 512) >> 10u) + between, -MOMENT, MOMENT);
}

// Two sets of pixels together.
fn both(a: Moments, b: Moments) -> Moments {
    if b.weight == 0u {
        return a;
    }
    if a.weight == 0u {
        return b;
    }
    let weight = a.weight + b.weight;
    let share = i32((b.weight << 10u) / weight);
    let mixed = (share * (1024 - share)) >> 10u;
    let away = clamp(b.mean - a.mean, vec2(-AWAY), vec2(AWAY));
    let apart = clamp(b.disparity - a.disparity, -APART, APART);
    let xy = away >> vec2(8u);
    let d = apart >> 6u;
    let squares = (vec3(xy.x * xy.x, xy.x * xy.y, xy.y * xy.y) * mixed + vec3(2048)) >> vec3(12u);
    let errors = (xy * d * mixed + vec2(2048)) >> vec2(12u);
    let spread = (d * d * mixed + 512) >> 10u;
    return Moments(
        weight,
        a.mean + ((away * share + vec2(512)) >> vec2(10u)),
        a.disparity + ((apart * share + 512) >> 10u),
        vec3(
            moment(a.squares.x, b.squares.x, share, squares.x),
            moment(a.squares.y, b.squares.y, share, squares.y),
            moment(a.squares.z, b.squares.z, share, squares.z),
        ),
        vec2(
            moment(a.errors.x, b.errors.x, share, errors.x),
            moment(a.errors.y, b.errors.y, share, errors.y),
        ),
        moment(a.dd, b.dd, share, spread),
    );
}

const NOTHING: Moments = Moments(0u, vec2<i32>(0), 0, vec3<i32>(0), vec2<i32>(0), 0);

// Sums along rows. One invocation per row of patches.
@compute @workgroup_size(GROUP)
fn carry_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let row = place(group, lane).x;
    if row >= params.band.rows {
        return;
    }
    let y = params.band.first_row + row;
    var carry = NOTHING;
    for (var x = params.across - 1u; x > 0u; x--) {
        set_back(x, y, carry);
        carry = carried(both(own_moments(x, y), carry), vec2(-1, 0), share_between(vec2(x - 1u, y), vec2(x, y)));
    }
    set_back(0u, y, carry);
    var line = own_moments(0u, y);
    set_sum(0u, y, both(line, carry));
    for (var x = 1u; x < params.across; x++) {
        line = both(own_moments(x, y), carried(line, vec2(1, 0), share_between(vec2(x - 1u, y), vec2(x, y))));
        set_sum(x, y, both(line, back_moments(x, y)));
    }
}

// What comes from below, by bands of rows from the last one on. One invocation per column of patches.
@compute @workgroup_size(GROUP)
fn rise(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = place(group, lane).x;
    if x >= params.across {
        return;
    }
    let end = params.band.first_row + params.band.rows;
    var carry = NOTHING;
    if end < params.down {
        carry = carried(
            both(sum_moments(x, end), back_moments(x, end)),
            vec2(0, -1),
            share_between(vec2(x, end - 1u), vec2(x, end)),
        );
    }
    for (var y = end - 1u; y > params.band.first_row; y--) {
        set_back(x, y, carry);
        carry = carried(both(sum_moments(x, y), carry), vec2(0, -1), share_between(vec2(x, y - 1u), vec2(x, y)));
    }
    set_back(x, params.band.first_row, carry);
}

// What comes from above, by bands of rows from the first one on, and the planes. One invocation per column of patches.
@compute @workgroup_size(GROUP)
fn sink(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = place(group, lane).x;
    if x >= params.across {
        return;
    }
    let first = params.band.first_row;
    var line = NOTHING;
    if first > 0u {
        line = sum_moments(x, first - 1u);
    }
    for (var y = first; y < first + params.band.rows; y++) {
        if y > 0u {
            line = carried(line, vec2(0, 1), share_between(vec2(x, y - 1u), vec2(x, y)));
        }
        line = both(sum_moments(x, y), line);
        let plane = fit(both(line, back_moments(x, y)));
        set_sum(x, y, line);
        let at = sum_at(x, y);
        let n = params.across;
        back[at] = plane.state;
        back[at + n] = plane.value;
        back[at + 2u * n] = plane.slopes.x;
        back[at + 3u * n] = plane.slopes.y;
    }
}

// The slopes along the axis with the larger moment and along the other one.
fn slopes(pp: i32, pq: i32, qq: i32, pd: i32, qd: i32) -> vec2<i32> {
    let tilt = clamp((pq << 11u) / pp, -2048, 2048);
    let q = max(qq - ((tilt * pq) >> 11u), 1);
    let rest = clamp(qd - ((tilt * pd) >> 11u), -MOMENT, MOMENT);
    let of_q = clamp((rest << 11u) / q, -STEEPEST, STEEPEST);
    let of_p = clamp((pd << 11u) / pp - ((tilt * of_q) >> 11u), -STEEPEST, STEEPEST);
    return vec2(of_p, of_q);
}

// A slope times a moment, in 1/256 px^2. (The product itself does not fit in 32 bits.)
fn product(slope: i32, moment: i32) -> i32 {
    return 2 * slope * (moment >> 10u) + ((slope * (moment & 1023)) >> 9u);
}

// The plane through these pixels.
fn fit(m: Moments) -> Plane {
    if m.weight < LEAST {
        return Plane(NO_PLANE, 0, vec2(0));
    }
    let xx = m.squares.x + RIDGE;
    let yy = m.squares.z + RIDGE;
    var tilt: vec2<i32>;
    if xx >= yy {
        tilt = slopes(xx, m.squares.y, yy, m.errors.x, m.errors.y);
    } else {
        tilt = slopes(yy, m.squares.y, xx, m.errors.y, m.errors.x).yx;
    }
    let up = (tilt * (m.mean >> vec2(6u))) >> vec2(7u);
    let rest = m.dd - product(tilt.x, m.errors.x) - product(tilt.y, m.errors.y);
    let state = select(PLANE, TRUSTED, rest < max(RESIDUAL, m.dd >> SHARE_BITS));
    return Plane(state, m.disparity - up.x - up.y, tilt);
}

// Filled pixels take the value of the plane of their patch. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn take(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let pixel = vec2(id.x, params.band.first_row + id.y);
    let plane = plane_of(pixel.x / PATCH, pixel.y / PATCH);
    if (flags[at] & FILLED) != 0u && plane.state == TRUSTED {
        let low = params.level.low;
        let range = FRACTION * vec2(low, low + i32(params.level.labels) - 1);
        disparity[at] = clamp(value_at(plane, pixel), range.x, range.y);
    }
}
