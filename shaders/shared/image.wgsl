// A pixel of the pair: red | green << 16, blue | grey << 16, 1 if masked.

fn colour_difference(a: vec4<u32>, b: vec4<u32>) -> u32 {
    let p = vec3<i32>(vec3(a.x & 0xffffu, a.x >> 16u, a.y & 0xffffu));
    let q = vec3<i32>(vec3(b.x & 0xffffu, b.x >> 16u, b.y & 0xffffu));
    let d = abs(p - q);
    return u32(d.x + d.y + d.z);
}
