// Messages of the resolution factors between a level and the next finer one, in both directions. One
// invocation per coarse pixel; vectors have one value for each of up to 2 x 2 children, in raster order. If
// no label agrees, sums are infinite: the largest value, at which they saturate.

#import band volume windows messages sections

struct Params {
    level: Level,
    @align(16) band: Band,
    @align(16) fine: Level,
    // Twice the smallest label of the level minus the finer level's smallest label: 0 or -1.
    label_offset: i32,
    // Cost of disagreement.
    tau: u32,
    // Offset of the volumes of the finer level in the bindings, in quads.
    fine_at: u32,
    // Whether the factors have sent messages; until then these are 0, whatever is stored.
    sent: u32,
}

@group(0) @binding(1) var<storage, read> fine_belief: array<u32>;
@group(0) @binding(2) var<storage, read> belief: array<u32>;
@group(0) @binding(3) var<storage, read_write> fine_down: array<u32>;
@group(0) @binding(4) var<storage, read_write> up: array<u32>;
@group(0) @binding(5) var<storage, read> windows: array<u32>;
@group(0) @binding(6) var<storage, read> fine_windows: array<u32>;

// First word of each child; children outside the image share the first child's.
var<private> children_at: vec4<u32>;
var<private> exists: vec4<bool>;
var<private> parent_at: u32;
// The minimum of each message to the factor, for absolute truncation.
var<private> child_floor: vec4<u32>;
var<private> parent_floor: u32;

// The last words read, with several labels each: beliefs minus messages.
var<private> child_word: u32;
var<private> children: vec4<u32>;
var<private> parent_word: u32;
var<private> parent: u32;

// Invalidates the last words read.
fn rewind() {
    child_word = 0xffffffffu;
    parent_word = 0xffffffffu;
}

// The values of a word of beliefs minus those of a word of messages, which are never larger; infinite where the belief is.
fn less(beliefs: u32, messages: u32) -> u32 {
    let highest = TOPS & beliefs & ((beliefs & ~TOPS) + BOTTOMS);
    return beliefs - ((messages * params.sent) & ~((highest >> (BITS - 1u)) * MOST));
}

// The lowest and the highest bit of each value in a word.
const BOTTOMS: u32 = 0xffffffffu / MOST;
const TOPS: u32 = BOTTOMS << (BITS - 1u);

// The children's messages to the factor for the fine label `index`.
fn from_children(index: i32) -> vec4<u32> {
    if index < 0 || index >= i32(params.fine.labels) {
        return vec4(MOST);
    }
    let label = u32(index);
    if label / PER_WORD != child_word {
        child_word = label / PER_WORD;
        let at = children_at + vec4(word_of(label, params.fine.width));
        children = vec4(
            less(fine_belief[at.x], fine_down[at.x]), less(fine_belief[at.y], fine_down[at.y]),
            less(fine_belief[at.z], fine_down[at.z]), less(fine_belief[at.w], fine_down[at.w]));
    }
    let q = (children >> vec4(BITS * (label % PER_WORD))) & vec4(MOST);
    return select(max(q, child_floor) - child_floor, vec4(MOST), q == vec4(MOST));
}

fn from_parent(label: u32) -> u32 {
    if label / PER_WORD != parent_word {
        parent_word = label / PER_WORD;
        let at = parent_at + word_of(label, params.level.width);
        parent = less(belief[at], up[at]);
    }
    let q = pick(parent, label);
    return select(max(q, parent_floor) - parent_floor, MOST, q == MOST);
}

// Results of one step over the coarse labels: sums to the parent and to the children for label z.
struct Sums {
    parent: u32,
    children: vec4<u32>,
    // Whether the parent has the label, and whether each child has a label that agrees with it.
    parent_has: bool,
    children_have: vec4<bool>,
}

// The children's messages at the fine label just above the last coarse label's centre.
var<private> between: Quad;

fn advance(z: u32) -> Sums {
    let centre = 2 * i32(z) + params.label_offset;
    var best = from_children(centre);
    if INTERPOLATING {
        let above = from_children(centre + 1);
        best = min(min(best, unpack(between)), above);
        between = pack(above);
    }
    let have = best != vec4(MOST);
    best = select(vec4<u32>(), best, exists);
    let q = from_parent(z);
    let sum = best.x + best.y + best.z + best.w;
    return Sums(min(sum, MOST), min(vec4(q + sum) - best, vec4(MOST)), q != MOST, have);
}

// The message for a sum, truncated; `least` is the smallest sum.
fn cut_message(sum: u32, least: u32) -> u32 {
    if ABSOLUTE {
        return min(sum, params.tau);
    }
    let low = min(least, MOST - params.tau);
    return min(sum, low + params.tau) - low;
}

var<private> up_word: u32;
var<private> down_words: vec4<u32>;

fn emit_up(label: u32, message: u32) {
    up_word |= message << (BITS * (label % PER_WORD));
    if label % PER_WORD == PER_WORD - 1u {
        up[parent_at + word_of(label, params.level.width)] = up_word;
        up_word = 0u;
    }
}

fn emit_down(index: i32, sums: vec4<u32>, least: vec4<u32>) {
    if index < 0 || index >= i32(4u * params.fine.quads) {
        return;
    }
    let label = u32(index);
    var message = vec4(params.tau);
    if label < params.fine.labels {
        message = vec4(
            cut_message(sums.x, least.x), cut_message(sums.y, least.y),
            cut_message(sums.z, least.z), cut_message(sums.w, least.w));
    }
    down_words |= message << vec4(BITS * (label % PER_WORD));
    if label % PER_WORD == PER_WORD - 1u {
        let at = children_at + vec4(word_of(label, params.fine.width));
        // The first child is written last, because children outside the image share its position.
        if exists.w {
            fine_down[at.w] = down_words.w;
        }
        if exists.z {
            fine_down[at.z] = down_words.z;
        }
        if exists.y {
            fine_down[at.y] = down_words.y;
        }
        fine_down[at.x] = down_words.x;
        down_words = vec4<u32>();
    }
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let fine = params.fine;
    let x = 2u * id.x;
    // The bound rows of the finer level start at twice the band's first row.
    let y = 2u * id.y;
    let right = x + 1u < fine.width;
    let below = 2u * params.band.first_row + y + 1u < fine.height;
    exists = vec4(true, right, below, right && below);
    let rows = vec4(y) + select(vec4<u32>(), vec4(0u, 0u, 1u, 1u), exists);
    let columns = vec4(x) + select(vec4<u32>(), vec4(0u, 1u, 0u, 1u), exists);
    children_at = QUAD_WORDS * (params.fine_at + rows * fine.pitch + columns);
    parent_at = QUAD_WORDS * (params.band.volume_at + id.y * params.level.pitch + id.x);
    child_floor = vec4<u32>();
    parent_floor = 0u;
    let labels = params.level.labels;
    // The children share a window.
    let own = ends(window_of(id.x, params.band.first_row + id.y));
    let theirs = ends(fine_windows[window_place(fine, x, 2u * params.band.first_row + y)]);
    // All coarse labels that either window needs, aligned so that coarse and fine labels start at whole words.
    let start = min(own.x, theirs.x / 8u * 4u);
    let end = max(own.y, theirs.y / 2u + 1u);
    rewind();

    if ABSOLUTE {
        var least = vec4(MOST);
        for (var d = theirs.x; d < theirs.y; d++) {
            least = min(least, from_children(i32(d)));
        }
        var least_of_parent = MOST;
        for (var z = own.x; z < min(own.y, labels); z++) {
            least_of_parent = min(least_of_parent, from_parent(z));
        }
        child_floor = least;
        parent_floor = least_of_parent;
        rewind();
    }

    // The smallest sums over the labels that the pixel has.
    var least_up = MOST;
    var least_down = vec4(MOST);
    let before = 2 * i32(start) + params.label_offset - 1;
    between = pack(from_children(before));
    for (var z = start; z < min(end, labels); z++) {
        let sums = advance(z);
        least_up = min(least_up, select(MOST, sums.parent, sums.parent_has));
        least_down = min(least_down, select(vec4(MOST), sums.children, sums.children_have));
    }

    up_word = 0u;
    down_words = vec4<u32>();
    rewind();
    between = pack(from_children(before));
    var last = pack(vec4(MOST));
    // Two fine labels per coarse label, padding included.
    for (var z = start; z < end; z++) {
        var sums = Sums(MOST, vec4(MOST), false, vec4<bool>());
        if z < labels {
            sums = advance(z);
        }
        if z < 4u * params.level.quads {
            emit_up(z, select(params.tau, cut_message(sums.parent, least_up), z < labels));
        }
        let centre = 2 * i32(z) + params.label_offset;
        emit_down(centre - 1, select(vec4(MOST), min(unpack(last), sums.children), INTERPOLATING), least_down);
        emit_down(centre, sums.children, least_down);
        last = pack(sums.children);
    }
}
