// The label map, and per pixel the squared difference from the one before. One invocation a pixel.

@group(0) @binding(1) var<storage, read> belief: array<Quad>;
@group(0) @binding(2) var<storage, read_write> labels: array<u32>;
@group(0) @binding(3) var<storage, read_write> squares: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let first = id.y * params.level.pitch;
    var least = vec4(0xffffffffu);
    for (var quad = 0u; quad < params.level.quads; quad++) {
        // Belief and label in one key; padding's beliefs are above all others.
        least = min(least, (unpack(belief[first + place_of(quad, id.x)]) << vec4(16u)) | labels_of(quad));
    }
    let label = smallest(least) & 0xffffu;
    let pixel = id.y * params.level.pixel_pitch + id.x;
    let difference = abs(i32(label) - i32(labels[pixel]));
    labels[pixel] = label;
    squares[pixel] = u32(difference * difference);
}
