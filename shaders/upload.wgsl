// Unpacks the pixels of both views from 8 bits per channel, a pixel in each word, or four grey ones: `unpack` at their own size, `halve` at full size and at half of it.
// One invocation per pixel of the level.

#import band

struct Params {
    level: Level,
    @align(16) band: Band,
    // Elements per row at full size.
    full_pitch: u32,
    // Whether the highest byte of a word counts for nothing.
    is_opaque: u32,
    // The bytes of a word of the frame: 0 red, green, blue, alpha; 1 blue, green, red, alpha; 2 four grey pixels.
    format: u32,
    // The last column of the frame, which the columns behind it repeat.
    last: u32,
}

const BGRA = 1u;
const GREY = 2u;

@group(0) @binding(0) var<uniform> params: Params;
// red | green << 8 | blue << 16, | 1 << 24 if masked.
@group(0) @binding(1) var<storage, read> left_words: array<u32>;
@group(0) @binding(2) var<storage, read> right_words: array<u32>;
@group(0) @binding(3) var<storage, read_write> left: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> right: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> full_left_words: array<u32>;
@group(0) @binding(6) var<storage, read> full_right_words: array<u32>;
// red | green << 8 | blue << 16, | 1 << 24 if masked; grey in 16 bits.
@group(0) @binding(7) var<storage, read_write> full_left: array<vec2<u32>>;
@group(0) @binding(8) var<storage, read_write> full_right: array<vec2<u32>>;

// red | green << 8 | blue << 16, | the highest byte.
fn ordered(word: u32) -> u32 {
    let exchanged = (word & 0xff00ff00u) | ((word & 0xffu) << 16u) | ((word >> 16u) & 0xffu);
    return select(word, exchanged, params.format == BGRA);
}

// The place of a pixel in words with rows of `pitch` words.
fn word_place(x: u32, y: u32, pitch: u32) -> u32 {
    let column = min(x, params.last);
    return y * pitch + select(column, column / 4u, params.format == GREY);
}

// A pixel of its own, from the word that holds it.
fn single(word: u32, x: u32) -> u32 {
    let grey = (word >> (8u * (min(x, params.last) % 4u))) & 0xffu;
    return select(word, grey * 0x10101u, params.format == GREY);
}

// Colour and grey in 16 bits.
fn colours(word: u32) -> vec4<u32> {
    let bytes = ordered(word);
    let colour = ((vec3(bytes) >> vec3(0u, 8u, 16u)) & vec3(0xffu)) << vec3(8u);
    return vec4(colour, (dot(colour, vec3(299u, 587u, 114u)) + 500u) / 1000u);
}

fn is_masked(word: u32) -> bool {
    return params.is_opaque == 0u && word >> 24u != 0u;
}

// A pixel of the pair.
fn pixel(colours: vec4<u32>, masked: bool) -> vec4<u32> {
    return vec4(colours.r | (colours.g << 16u), colours.b | (colours.a << 16u), u32(masked), 0u);
}

@compute @workgroup_size(GROUP)
fn unpack(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    let source = word_place(id.x, id.y, params.level.pixel_pitch);
    let words = vec2(single(left_words[source], id.x), single(right_words[source], id.x));
    left[at] = pixel(colours(words.x), is_masked(words.x));
    right[at] = pixel(colours(words.y), is_masked(words.y));
}

// The pixel at full size for a word.
fn full_pixel(word: u32) -> vec2<u32> {
    return vec2((ordered(word) & 0xffffffu) | (u32(is_masked(word)) << 24u), colours(word).a);
}

// Adds the colours of an unmasked pixel to `sum`, and 1 to `count`.
fn add(word: u32, sum: ptr<function, vec4<u32>>, count: ptr<function, u32>) {
    if !is_masked(word) {
        *sum += colours(word);
        *count += 1u;
    }
}

// The mean of the unmasked pixels of a block, rounded to the nearest value, halves up; masked if all are.
fn mean(sum: vec4<u32>, count: u32) -> vec4<u32> {
    let divisor = max(2u * count, 1u);
    return pixel((2u * sum + count) / divisor, count == 0u);
}

@compute @workgroup_size(GROUP)
fn halve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    var left_sum = vec4<u32>();
    var right_sum = vec4<u32>();
    var left_count = 0u;
    var right_count = 0u;
    for (var i = 0u; i < 4u; i++) {
        let x = 2u * id.x + i % 2u;
        let y = 2u * id.y + i / 2u;
        let at = y * params.full_pitch + x;
        let source = word_place(x, y, params.full_pitch);
        let words = vec2(single(full_left_words[source], x), single(full_right_words[source], x));
        full_left[at] = full_pixel(words.x);
        full_right[at] = full_pixel(words.y);
        add(words.x, &left_sum, &left_count);
        add(words.y, &right_sum, &right_count);
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    left[at] = mean(left_sum, left_count);
    right[at] = mean(right_sum, right_count);
}
