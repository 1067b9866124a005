// Votes of valid pixels for filled and doubtful ones, over half-size pixels and every second label. `halve` and `show` prepare. Then
// `own_votes`, `sum_rows`, `sum_columns` and `elect` run for each band of half-size rows, and finally `take`.

#import band image maps

struct Params {
    level: Level,
    @align(16) band: Band,
    half_width: u32,
    half_height: u32,
    // Words per row of half-size pixels, and of the sums.
    half_pitch: u32,
    sum_pitch: u32,
    // Number of labels that are voted for.
    labels: u32,
    // 1 if smaller labels are nearer, else 0.
    smaller_is_nearer: u32,
    // First bound rows of half-size pixels, of the sums along rows and of the votes.
    first_summed: u32,
    first_voted: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> left: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
// label | best << 16, runner-up.
@group(0) @binding(3) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> disparity: array<i32>;
// Nearness, from 1 on, of the label at each pixel of the right view; 0 where none is known.
@group(0) @binding(5) var<storage, read_write> shown: array<atomic<u32>>;
// Half-size pixels: red | green << 8 | blue << 16, and ASKED if their vote is needed.
@group(0) @binding(6) var<storage, read_write> half_colours: array<u32>;
// By row, half-size pixel and label: votes, then their sums along the row.
@group(0) @binding(7) var<storage, read_write> sums: array<u32>;
// The sums along columns.
@group(0) @binding(8) var<storage, read_write> totals: array<u32>;
// Votes in 1/256 px, or NONE.
@group(0) @binding(9) var<storage, read_write> elected: array<i32>;
// Weights of steps along a row, then along a column, by the difference in colour.
@group(0) @binding(10) var<storage, read> vote_weights: array<u32>;

const ASKED: u32 = 0x1000000u;
const NONE: i32 = -0x7fffffff;

// Whether a pixel with these flags is sure.
fn is_sure(flags: u32) -> bool {
    return is_valid(flags) && ((flags >> 8u) & 0xffu) >= VOTE_SURE;
}

// Whether a pixel with these flags may be outvoted.
fn may_be_outvoted(flags: u32) -> bool {
    return is_valid(flags) && !is_sure(flags);
}

// Nearness of the surface of a label.
fn near(label: u32) -> u32 {
    return select(label, params.level.labels - 1u - label, params.smaller_is_nearer == 1u);
}

// Column of the right view to which label `label` projects from column x.
fn column(x: u32, label: u32) -> i32 {
    return i32(x) - params.level.low - i32(label);
}

fn is_inside(column: i32) -> bool {
    return column >= 0 && column < i32(params.level.width);
}

// 8-bit colour of a pixel.
fn colour(at: u32) -> vec3<u32> {
    return channels(left[at]) >> vec3(8u);
}

// Colour of a half-size pixel.
fn half_colour(at: u32) -> vec3<u32> {
    return unpacked(half_colours[at]);
}

// weight / 65536 of sum.
fn weighted(weight: u32, sum: u32) -> u32 {
    return (sum >> 16u) * weight + (((sum & 0xffffu) * weight) >> 16u);
}

// The labels that sure pixels show in the right view, after `halve`. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn show(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    if is_sure(flags[row + id.x]) {
        let label = optima[row + id.x].x & 0xffffu;
        let to = column(id.x, label);
        if is_inside(to) {
            atomicMax(&shown[row + u32(to)], 1u + near(label));
        }
    }
}

// Colours of half-size pixels, and whether their votes are needed; nothing is shown yet. One invocation per
// half-size pixel; the bound rows of the image start up to two rows above the band.
@compute @workgroup_size(GROUP)
fn halve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.half_width || id.y >= params.band.rows {
        return;
    }
    let x = 2u * id.x;
    let y = 2u * (params.band.first_row + id.y);
    let top = max(2u * params.band.first_row, 2u) - 2u;
    let last = vec2(params.level.width, params.level.height) - vec2(1u);
    var sum = vec3(0u);
    var count = 0u;
    var asked = 0u;
    for (var v = y; v <= min(y + 1u, last.y); v++) {
        for (var u = x; u <= min(x + 1u, last.x); u++) {
            let at = (v - top) * params.level.pixel_pitch + u;
            if left[at].z == 0u {
                sum += colour(at);
                count++;
            }
            if may_be_outvoted(flags[at]) {
                asked = ASKED;
            }
            atomicStore(&shown[(v - 2u * params.band.first_row) * params.level.pixel_pitch + u], 0u);
        }
    }
    let mean = select(vec3(0u), (2u * sum + vec3(count)) / vec3(2u * max(count, 1u)), count > 0u);
    for (var v = max(y, 2u) - 2u; v <= min(y + 3u, last.y); v++) {
        for (var u = max(x, 2u) - 2u; u <= min(x + 3u, last.x); u++) {
            if is_filled(flags[(v - top) * params.level.pixel_pitch + u]) {
                asked = ASKED;
            }
        }
    }
    half_colours[id.y * params.half_pitch + id.x] = packed(mean) | asked;
}

// Votes of each half-size pixel. One invocation per half-size pixel and label.
@compute @workgroup_size(GROUP)
fn own_votes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.half_width * params.labels || id.y >= params.band.rows {
        return;
    }
    let half_x = id.x / params.labels;
    let label = 2u * (id.x - half_x * params.labels);
    let wanted = FRACTION * (params.level.low + i32(label));
    let y = 2u * (params.band.first_row + id.y);
    var sum = 0u;
    for (var v = 0u; v < min(params.level.height - y, 2u); v++) {
        let row = (2u * id.y + v) * params.level.pixel_pitch;
        for (var x = 2u * half_x; x < min(2u * half_x + 2u, params.level.width); x++) {
            let validity = flags[row + x];
            if is_valid(validity) {
                sum += u32(min(abs(disparity[row + x] - wanted), VOTE_MOST)) >> VOTE_BITS;
            } else if (validity & MASKED) == 0u {
                let to = column(x, label);
                if is_inside(to) {
                    let seen = atomicLoad(&shown[row + u32(to)]);
                    if seen > 0u && 1u + near(label) >= seen + HIDING_LABELS {
                        sum += VOTE_HIDING;
                    }
                }
            }
        }
    }
    sums[id.y * params.sum_pitch + id.x] = sum << VOTE_FRACTION_BITS;
}

// Sums votes along rows. One invocation per row and label.
@compute @workgroup_size(GROUP)
fn sum_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.labels || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.half_pitch;
    var at = id.y * params.sum_pitch + id.x;
    var sum = sums[at];
    for (var x = 1u; x < params.half_width; x++) {
        let weight = vote_weights[difference(half_colour(row + x - 1u), half_colour(row + x))];
        at += params.labels;
        sum = sums[at] + weighted(weight, sum);
        sums[at] = sum;
    }
    sums[at] = sum >> VOTE_SHIFT;
    var carried = 0u;
    for (var x = params.half_width - 1u; x > 0u; x--) {
        let weight = vote_weights[difference(half_colour(row + x - 1u), half_colour(row + x))];
        at -= params.labels;
        let before = sums[at];
        carried = weighted(weight, carried + (sum - weighted(weight, before)));
        sums[at] = (before + carried) >> VOTE_SHIFT;
        sum = before;
    }
}

// Weight of the step along column x between rows a and b of half-size pixels.
fn step_weight(x: u32, a: u32, b: u32) -> u32 {
    let first = params.first_summed;
    let one = half_colour((a - first) * params.half_pitch + x);
    let other = half_colour((b - first) * params.half_pitch + x);
    return vote_weights[COLOUR_DIFFERENCES + difference(one, other)];
}

// Sums along columns, where votes are needed. One invocation per half-size pixel and label.
@compute @workgroup_size(GROUP)
fn sum_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.half_width * params.labels || id.y >= params.band.rows {
        return;
    }
    let first = params.first_summed;
    let x = id.x / params.labels;
    let y = params.band.first_row + id.y;
    if (half_colours[(y - first) * params.half_pitch + x] & ASKED) == 0u {
        return;
    }
    var from_above = 0u;
    for (var row = max(y, VOTE_REACH) - VOTE_REACH; row < y; row++) {
        let sum = sums[(row - first) * params.sum_pitch + id.x];
        from_above = weighted(step_weight(x, row, row + 1u), sum + from_above);
    }
    var from_below = 0u;
    for (var row = min(y + VOTE_REACH, params.half_height - 1u); row > y; row--) {
        let sum = sums[(row - first) * params.sum_pitch + id.x];
        from_below = weighted(step_weight(x, row, row - 1u), sum + from_below);
    }
    let own = sums[(y - first) * params.sum_pitch + id.x];
    totals[id.y * params.sum_pitch + id.x] = own + from_above + from_below;
}

// The votes. One invocation per half-size pixel.
@compute @workgroup_size(GROUP)
fn elect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.half_width || id.y >= params.band.rows {
        return;
    }
    let here = id.y * params.half_pitch + id.x;
    elected[here] = NONE;
    if (half_colours[here] & ASKED) == 0u {
        return;
    }
    let at = id.y * params.sum_pitch + id.x * params.labels;
    var best = 0u;
    var least = totals[at];
    var most = least;
    for (var i = 1u; i < params.labels; i++) {
        let sum = totals[at + i];
        most = max(most, sum);
        if sum < least {
            least = sum;
            best = i;
        }
    }
    if most == least {
        return;
    }
    var offset = 0;
    if best > 0u && best + 1u < params.labels {
        var below = totals[at + best - 1u] - least;
        var above = totals[at + best + 1u] - least;
        let halvings = max(firstLeadingBit(max(below, above) | 1u), 15u) - 15u;
        below >>= halvings;
        above >>= halvings;
        let slope = max(below, above);
        if slope > 0u {
            // Adding the slope first makes the dividend non-negative and the quotient larger by 256.
            offset = i32((512u * (below + slope - above) + slope) / (2u * slope)) - 256;
        }
    }
    elected[here] = FRACTION * (params.level.low + 2 * i32(best)) + offset;
}

// Filled pixels take the vote of the most similar half-size pixel around them, outvoted ones that of their
// own. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn take(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let middle = vec2(id.x, params.band.first_row + id.y) >> vec2(1u);
    if !is_filled(flags[at]) {
        let vote = elected[(middle.y - params.first_voted) * params.half_pitch + middle.x];
        if may_be_outvoted(flags[at]) && vote != NONE && abs(vote - disparity[at]) > VOTE_OUTVOTES {
            disparity[at] = vote;
            flags[at] = OUTVOTED | FILLED;
        }
        return;
    }
    let own = colour(at);
    var least = 0xffffffffu;
    for (var y = max(middle.y, 1u) - 1u; y <= min(middle.y + 1u, params.half_height - 1u); y++) {
        for (var x = max(middle.x, 1u) - 1u; x <= min(middle.x + 1u, params.half_width - 1u); x++) {
            let half = (y - params.first_voted) * params.half_pitch + x;
            let vote = elected[half];
            if vote != NONE {
                let away = max(vec2(x, y), middle) - min(vec2(x, y), middle);
                let unlike = difference(own, half_colour(half)) + VOTE_AWAY * (away.x + away.y);
                if unlike < least {
                    least = unlike;
                    disparity[at] = vote;
                }
            }
        }
    }
}
