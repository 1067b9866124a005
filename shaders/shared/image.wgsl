// A pixel of the pair: red | green << 16, blue | grey << 16, 1 if masked.

fn channels(pixel: vec4<u32>) -> vec3<u32> {
    return vec3(pixel.x & 0xffffu, pixel.x >> 16u, pixel.y & 0xffffu);
}

// Sum of absolute differences of three channels.
fn difference(a: vec3<u32>, b: vec3<u32>) -> u32 {
    let d = max(a, b) - min(a, b);
    return d.x + d.y + d.z;
}

// Packs an 8-bit colour into a word, red | green << 8 | blue << 16; `unpacked` reverses it.
fn packed(colour: vec3<u32>) -> u32 {
    return colour.x | (colour.y << 8u) | (colour.z << 16u);
}

fn unpacked(word: u32) -> vec3<u32> {
    return (vec3(word) >> vec3(0u, 8u, 16u)) & vec3(255u);
}
