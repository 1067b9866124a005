// Labels of the right view, from beliefs of the left view in the given columns. One invocation per right pixel.

#import band volume messages

struct Params {
    level: Level,
    @align(16) band: Band,
    // The columns of the left view to use.
    first_column: u32,
    columns: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> belief: array<u32>;
@group(0) @binding(2) var<storage, read> left: array<vec4<u32>>;
// label | belief << 16; all bits are set where no left pixel projects.
@group(0) @binding(3) var<storage, read_write> right_labels: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pitch * QUAD_WORDS;
    // Left pixel x + low + j projects to this pixel at label j.
    let shift = i32(id.x) + params.level.low;
    let first = i32(params.first_column);
    let start = max(first - shift, 0);
    let end = min(first + i32(params.columns) - shift, i32(params.level.labels));
    var least = 0xffffffffu;
    for (var j = start; j < end; j++) {
        let label = u32(j);
        let b = pick(belief[row + QUAD_WORDS * u32(shift + j) + word_of(label, params.level.width)], label);
        let found = (b << 16u) | label;
        if b != MOST && found < least && left[id.y * params.level.pixel_pitch + u32(shift + j)].z == 0u {
            least = found;
        }
    }
    right_labels[id.y * params.level.pixel_pitch + id.x] = least;
}
