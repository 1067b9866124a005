// What every stage is told, one block for each dispatch: the level it works on, for stages between two levels
// also the next finer one, and the band of rows. Rows of every volume start at a multiple of 256 bytes, so that
// any range of rows can be bound; pitches are in 32-bit words.

struct Level {
    width: u32,
    height: u32,
    // Smallest label.
    low: i32,
    labels: u32,
    // Labels with padding, in quads of four.
    quads: u32,
    // Words in a row of a volume of 8-bit values, one a label; 16-bit ones take twice as many.
    pitch: u32,
    // The same of dependency messages.
    dependency_pitch: u32,
    // Words in a row of member codes.
    member_pitch: u32,
    // Elements in a row of what has one element a pixel.
    pixel_pitch: u32,
    // Words in a row of the starts of the transposed table.
    starts_pitch: u32,
}

struct Params {
    @align(16) level: Level,
    @align(16) fine: Level,
    // The band: the stage works on rows first_row .. first_row + rows of the level.
    @align(16) first_row: u32,
    rows: u32,
    // Workgroups that make up a row, and workgroups of the dispatch in x.
    row_groups: u32,
    grid: u32,
    outside_cost: u32,
    // Cost of the largest colour difference that counts, and the variance from which on it counts in full.
    colour_weight: u32,
    colour_variance: u32,
    sad_radius: i32,
    // Twice the smallest label of the level less the finer level's smallest label: 0 or -1.
    label_offset: i32,
    evidence_multiplier: u32,
    evidence_limit: u32,
    evidence_up: u32,
    evidence_down: u32,
    evidence_cap: u32,
    // Truncation of the messages that the stage writes.
    tau: u32,
    // What of the method is wanted, 1 or 0.
    sub_pixel: u32,
    left_right_check: u32,
    median_all: u32,
    // Regions of fewer pixels are too small.
    speckle_size: u32,
    confidence_floor: u32,
    // Rows around the band that the stage sees.
    halo: u32,
    // Rows of the blocks that are joined, 0 to join the segments of each row, and the columns to do it in; for the right
    // view the left columns that count.
    span: u32,
    first_column: u32,
    columns: u32,
    // Rows of the map that the fill takes values from.
    source_first_row: u32,
    source_rows: u32,
    // In places, which are 2 to median_step_bits pixels apart.
    median_radius: u32,
    median_step_bits: u32,
    median_scale: u32,
    median_doublings: u32,
    // Rows of places are 2 to this many places apart.
    median_row_bits: u32,
    // Largest belief: what exceeds it counts as it.
    belief_most: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

const GROUP: u32 = 64u;

// Column and row of an invocation. Rows follow each other in workgroups that fold where a dispatch allows no more of
// them in one dimension.
fn place(group: vec3<u32>, lane: u32) -> vec2<u32> {
    let linear = group.x + group.y * params.grid;
    let row = linear / params.row_groups;
    return vec2((linear - row * params.row_groups) * GROUP + lane, row);
}

// Rows that a stage reads above its band start here.
fn halo_start(halo: u32) -> u32 {
    return max(params.first_row, halo) - halo;
}

// Two 16-bit values a word, the lower first.
fn unpack_wide(words: vec2<u32>) -> vec4<u32> {
    return vec4(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu, words.y >> 16u);
}

fn pack_wide(values: vec4<u32>) -> vec2<u32> {
    return vec2(values.x | (values.y << 16u), values.z | (values.w << 16u));
}

// Four 8-bit values a word, the lowest first.
fn unpack_narrow(word: u32) -> vec4<u32> {
    return (vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(0xffu);
}

fn pack_narrow(values: vec4<u32>) -> u32 {
    return values.x | (values.y << 8u) | (values.z << 16u) | (values.w << 24u);
}

// Of messages and beliefs: labels that a word holds, words of a quad of labels, and the largest value, which stands for
// infinity.
const PER_WORD: u32 = 32u / BITS;
const QUAD_WORDS: u32 = 4u / PER_WORD;
const MOST: u32 = 0xffffffffu >> (32u - BITS);

// The value of a label in the word that holds it.
fn pick(word: u32, label: u32) -> u32 {
    return (word >> (BITS * (label % PER_WORD))) & MOST;
}

// Which labels of a quad there are; the others are padding.
fn are_labels(quad: u32) -> vec4<bool> {
    return labels_of(quad) < vec4(params.level.labels);
}

// A row of a volume holds the first quad of all its pixels, then their second, and so on (and of dependency messages all
// of one slot, then all of the next), so that neighbouring invocations touch neighbouring words. Where a pixel's quad is:
fn place_of(quad: u32, x: u32) -> u32 {
    return quad * params.level.width + x;
}

// How far the word of a label is from the first word of its pixel, in volumes of messages and beliefs of that width.
fn word_of(label: u32, width: u32) -> u32 {
    return QUAD_WORDS * (label / 4u) * width + (label % 4u) / PER_WORD;
}

fn labels_of(quad: u32) -> vec4<u32> {
    return vec4(4u * quad) + vec4(0u, 1u, 2u, 3u);
}

fn smallest(values: vec4<u32>) -> u32 {
    return min(min(values.x, values.y), min(values.z, values.w));
}
