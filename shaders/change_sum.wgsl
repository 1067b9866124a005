// Sums the squared differences of each row, in 64 bits. One invocation a row.

@group(0) @binding(1) var<storage, read> squares: array<u32>;
// Lower and upper half.
@group(0) @binding(2) var<storage, read_write> sums: array<vec2<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.rows || id.y > 0u {
        return;
    }
    var sum = vec2<u32>();
    for (var x = 0u; x < params.level.width; x++) {
        let low = sum.x + squares[id.x * params.level.pixel_pitch + x];
        sum = vec2(low, sum.y + u32(low < sum.x));
    }
    sums[params.first_row + id.x] = sum;
}
