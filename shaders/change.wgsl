// The label map, and per pixel the squared difference from the one before. One invocation a pixel.

@group(0) @binding(1) var<storage, read> belief: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> labels: array<u32>;
@group(0) @binding(3) var<storage, read_write> squares: array<u32>;

const LANES: vec4<u32> = vec4(0u, 1u, 2u, 3u);

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let first = id.y * params.level.pitch + id.x * params.level.quads;
    var least = vec4(0xffffffffu);
    for (var quad = 0u; quad < params.level.quads; quad++) {
        let label = vec4(4u * quad) + LANES;
        let key = (unpack_wide(belief[first + quad]) << vec4(16u)) | label;
        least = min(least, select(vec4(0xffffffffu), key, label < vec4(params.level.labels)));
    }
    let label = smallest(least) & 0xffffu;
    let pixel = id.y * params.level.pixel_pitch + id.x;
    let difference = abs(i32(label) - i32(labels[pixel]));
    labels[pixel] = label;
    squares[pixel] = u32(difference * difference);
}
