// Planes through measured pixels, carried from patch to patch. Twice `gather`, `carry_rows`, `rise` and `sink`, then `take`.

#import band image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // (columns, rows) of patches.
    across: u32,
    down: u32,
    // Words per row of patches.
    pitch: u32,
    // First bound row of patches.
    first_bound: u32,
    // 1 in the second round, when planes exist, else 0.
    again: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> disparity: array<i32>;
// By row of patches, number by number: own moments (OWN) and colours (COLOUR); moments summed along the row
// so far, then also from above (SUM); moments from the right, then from below, and finally planes (BACK).
@group(0) @binding(4) var<storage, read_write> patches: array<i32>;
// Share of weight that is left after a step, in 1/256, by the difference of two patches.
@group(0) @binding(5) var<storage, read> patch_shares: array<u32>;

// Index of the first number of each of these.
const OWN: u32 = 0u;
const COLOUR: u32 = 10u;
const SUM: u32 = 11u;
const BACK: u32 = 21u;

const NO_PLANE: i32 = 0;
const PLANE: i32 = 1;
const TRUSTED: i32 = 2;

// Weighted moments of measured pixels; the mean position is relative to the middle of a patch.
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

// A plane: its state (NO_PLANE, PLANE or TRUSTED), its value in the middle of the patch, and its slopes.
struct Plane {
    state: i32,
    value: i32,
    slopes: vec2<i32>,
}

// Index of number `number` of a patch.
fn place_of(number: u32, at: vec2<u32>) -> u32 {
    return (at.y - params.first_bound) * params.pitch + number * params.across + at.x;
}

// The moments of a patch that start at number `first`.
fn moments(first: u32, at: vec2<u32>) -> Moments {
    let i = place_of(first, at);
    let n = params.across;
    return Moments(
        u32(patches[i]), vec2(patches[i + n], patches[i + 2u * n]), patches[i + 3u * n],
        vec3(patches[i + 4u * n], patches[i + 5u * n], patches[i + 6u * n]),
        vec2(patches[i + 7u * n], patches[i + 8u * n]), patches[i + 9u * n],
    );
}

fn set_moments(first: u32, at: vec2<u32>, m: Moments) {
    let i = place_of(first, at);
    let n = params.across;
    patches[i] = i32(m.weight);
    patches[i + n] = m.mean.x;
    patches[i + 2u * n] = m.mean.y;
    patches[i + 3u * n] = m.disparity;
    patches[i + 4u * n] = m.squares.x;
    patches[i + 5u * n] = m.squares.y;
    patches[i + 6u * n] = m.squares.z;
    patches[i + 7u * n] = m.errors.x;
    patches[i + 8u * n] = m.errors.y;
    patches[i + 9u * n] = m.dd;
}

fn plane_of(at: vec2<u32>) -> Plane {
    let i = place_of(BACK, at);
    let n = params.across;
    return Plane(patches[i], patches[i + n], vec2(patches[i + 2u * n], patches[i + 3u * n]));
}

fn set_plane(at: vec2<u32>, plane: Plane) {
    let i = place_of(BACK, at);
    let n = params.across;
    patches[i] = plane.state;
    patches[i + n] = plane.value;
    patches[i + 2u * n] = plane.slopes.x;
    patches[i + 3u * n] = plane.slopes.y;
}

// Distance of a pixel from the middle of its patch, in half pixels.
fn from_middle(pixel: vec2<u32>) -> vec2<i32> {
    return 2 * vec2<i32>(pixel % vec2(PATCH)) - vec2(i32(PATCH) - 1);
}

// The value of a plane at a pixel of its patch, in 1/256 px.
fn value_at(plane: Plane, pixel: vec2<u32>) -> i32 {
    let up = (plane.slopes * from_middle(pixel)) >> vec2(4u);
    return (plane.value + up.x + up.y + 2) >> 2u;
}

// The patches' own moments and colours. One invocation per patch.
@compute @workgroup_size(GROUP)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.across || id.y >= params.band.rows {
        return;
    }
    let here = vec2(id.x, params.band.first_row + id.y);
    let top = PATCH * params.band.first_row;
    let first = PATCH * here;
    let end = min(first + vec2(PATCH), vec2(params.level.width, params.level.height));
    var plane = Plane(NO_PLANE, 0, vec2(0));
    if params.again == 1u {
        plane = plane_of(here);
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
    let all = max(s, 1);
    let e = error / all;
    set_moments(OWN, here, Moments(
        (u32(s) + ((1u << WEIGHT_BITS) >> 1u)) >> WEIGHT_BITS,
        512 * to / all,
        4 * reference + 64 * error / all,
        (squares - vec3(to.x * to.x, to.x * to.y, to.y * to.y) / all) / all,
        (errors - to * e) / (2 * all),
        (spread - error * e) / all,
    ));
    let mean = (2u * red_green_blue + vec3(count)) / vec3(max(2u * count, 1u));
    patches[place_of(COLOUR, here)] = i32(packed(mean));
}

// Share of the weight that is left after the step between two patches, in 1/256.
fn share_between(a: vec2<u32>, b: vec2<u32>) -> u32 {
    let colours = vec2(u32(patches[place_of(COLOUR, a)]), u32(patches[place_of(COLOUR, b)]));
    var apart = difference(unpacked(colours.x), unpacked(colours.y));
    let one = moments(OWN, a);
    let other = moments(OWN, b);
    if one.weight > 0u && other.weight > 0u {
        apart += u32(max(abs(one.disparity - other.disparity) - STEP, 0)) >> STEP_BITS;
    }
    return patch_shares[min(apart, LAST_SHARE)];
}

// Moments relative to a patch that is `step` patches away, with `share` / 256 of their weight.
fn carried(m: Moments, step: vec2<i32>, share: u32) -> Moments {
    var out = m;
    out.mean = clamp(m.mean - 1024 * i32(PATCH) * step, vec2(-REACH), vec2(REACH));
    out.weight = (m.weight * share) >> 8u;
    return out;
}

// One moment of two merged sets, from the moment of each and the term `between` them.
fn moment(a: i32, b: i32, share: i32, between: i32) -> i32 {
    return clamp(a + (((b - a) * share + 512) >> 10u) + between, -MOMENT, MOMENT);
}

// Merges the moments of two sets of pixels.
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
        let here = vec2(x, y);
        set_moments(BACK, here, carry);
        carry = carried(both(moments(OWN, here), carry), vec2(-1, 0), share_between(vec2(x - 1u, y), here));
    }
    set_moments(BACK, vec2(0u, y), carry);
    var line = NOTHING;
    for (var x = 0u; x < params.across; x++) {
        let here = vec2(x, y);
        if x > 0u {
            line = carried(line, vec2(1, 0), share_between(vec2(x - 1u, y), here));
        }
        line = both(moments(OWN, here), line);
        set_moments(SUM, here, both(line, moments(BACK, here)));
    }
}

// Moments from below, by bands of rows from the last to the first. One invocation per column of patches.
@compute @workgroup_size(GROUP)
fn rise(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = place(group, lane).x;
    if x >= params.across {
        return;
    }
    let first = params.band.first_row;
    let end = first + params.band.rows;
    var carry = NOTHING;
    if end < params.down {
        let below = vec2(x, end);
        let sum = both(moments(SUM, below), moments(BACK, below));
        carry = carried(sum, vec2(0, -1), share_between(vec2(x, end - 1u), below));
    }
    for (var y = end - 1u; y > first; y--) {
        let here = vec2(x, y);
        set_moments(BACK, here, carry);
        carry = carried(both(moments(SUM, here), carry), vec2(0, -1), share_between(vec2(x, y - 1u), here));
    }
    set_moments(BACK, vec2(x, first), carry);
}

// Moments from above, by bands from the first to the last, and planes. One invocation per column of patches.
@compute @workgroup_size(GROUP)
fn sink(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let x = place(group, lane).x;
    if x >= params.across {
        return;
    }
    let first = params.band.first_row;
    var line = NOTHING;
    if first > 0u {
        line = moments(SUM, vec2(x, first - 1u));
    }
    for (var y = first; y < first + params.band.rows; y++) {
        let here = vec2(x, y);
        if y > 0u {
            line = carried(line, vec2(0, 1), share_between(vec2(x, y - 1u), here));
        }
        line = both(moments(SUM, here), line);
        // Written first to save registers.
        set_moments(SUM, here, line);
        set_plane(here, fit(both(line, moments(BACK, here))));
    }
}

// (slope along the axis p with the larger moment, slope along the other axis q).
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

// The plane through the pixels with these moments.
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

// Filled pixels take the value of the plane of their patch, and so do doubtful measured ones that are far
// from it. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn take(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let pixel = vec2(id.x, params.band.first_row + id.y);
    let plane = plane_of(pixel / PATCH);
    let in_doubt = is_valid(flags[at]) && ((flags[at] >> 8u) & 0xffu) < DOUBT;
    if plane.state == TRUSTED {
        let low = params.level.low;
        let range = FRACTION * vec2(low, low + i32(params.level.labels) - 1);
        let value = clamp(value_at(plane, pixel), range.x, range.y);
        if is_filled(flags[at]) {
            disparity[at] = value;
        } else if in_doubt && abs(value - disparity[at]) > OUTVOTES {
            disparity[at] = value;
            flags[at] = OUTVOTED | FILLED;
        }
    }
}
