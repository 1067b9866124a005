// Volumes: four labels of a pixel form a quad, in one word of 8-bit values or two words of 16-bit values.

// Two 16-bit values per word, the lower first.
fn unpack_wide(words: vec2<u32>) -> vec4<u32> {
    return vec4(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu, words.y >> 16u);
}

fn pack_wide(values: vec4<u32>) -> vec2<u32> {
    return vec2(values.x | (values.y << 16u), values.z | (values.w << 16u));
}

// Four 8-bit values per word, the lowest first.
fn unpack_narrow(word: u32) -> vec4<u32> {
    return (vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(0xffu);
}

fn pack_narrow(values: vec4<u32>) -> u32 {
    return values.x | (values.y << 8u) | (values.z << 16u) | (values.w << 24u);
}

// Which entries of a quad are labels; the others are padding.
fn are_labels(quad: u32) -> vec4<bool> {
    return labels_of(quad) < vec4(params.level.labels);
}

// Position of a pixel's quad in a row. A row of a volume has the first quads of all its pixels, then the
// second ones, and so on; dependency messages have all quads of one slot, then of the next. Thus neighbouring
// invocations access neighbouring words.
fn place_of(quad: u32, x: u32) -> u32 {
    return quad * params.level.width + x;
}

fn labels_of(quad: u32) -> vec4<u32> {
    return vec4(4u * quad) + vec4(0u, 1u, 2u, 3u);
}

fn smallest(values: vec4<u32>) -> u32 {
    return min(min(values.x, values.y), min(values.z, values.w));
}
