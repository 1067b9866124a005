// A pixel of the pair: red | green << 16, blue | grey << 16, 1 if masked.

fn channels(pixel: vec4<u32>) -> vec3<u32> {
    return vec3(pixel.x & 0xffffu, pixel.x >> 16u, pixel.y & 0xffffu);
}

// Sum of the differences of three channels.
fn difference(a: vec3<u32>, b: vec3<u32>) -> u32 {
    let d = max(a, b) - min(a, b);
    return d.x + d.y + d.z;
}
