// Whether each row holds any valid pixel. One invocation a row.

@group(0) @binding(1) var<storage, read> flags: array<u32>;
// Of all rows: 1 or 0.
@group(0) @binding(2) var<storage, read_write> filled: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.rows || id.y > 0u {
        return;
    }
    var x = 0u;
    while x < params.level.width && !is_valid(flags[id.x * params.level.pixel_pitch + x]) {
        x++;
    }
    filled[params.first_row + id.x] = u32(x < params.level.width);
}
