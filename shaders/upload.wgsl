// Unpacks the pixels of both views from words with 8 bits per channel. One invocation per pixel.

#import band

struct Params {
    level: Level,
    @align(16) band: Band,
}

@group(0) @binding(0) var<uniform> params: Params;
// red | green << 8 | blue << 16, | 1 << 24 if masked.
@group(0) @binding(1) var<storage, read> left_words: array<u32>;
@group(0) @binding(2) var<storage, read> right_words: array<u32>;
@group(0) @binding(3) var<storage, read_write> left: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> right: array<vec4<u32>>;

fn pixel(word: u32) -> vec4<u32> {
    let colour = ((vec3(word) >> vec3(0u, 8u, 16u)) & vec3(0xffu)) << vec3(8u);
    let grey = (dot(colour, vec3(299u, 587u, 114u)) + 500u) / 1000u;
    return vec4(colour.r | (colour.g << 16u), colour.b | (grey << 16u), word >> 24u, 0u);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    left[at] = pixel(left_words[at]);
    right[at] = pixel(right_words[at]);
}
