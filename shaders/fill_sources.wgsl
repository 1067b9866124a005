// The row that each row takes its values from: the nearest that holds a valid pixel, the upper of two; itself where
// none does. One invocation a row.

@group(0) @binding(1) var<storage, read> filled: array<u32>;
@group(0) @binding(2) var<storage, read_write> sources: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let y = id.x;
    let height = params.level.height;
    if y >= height || id.y > 0u {
        return;
    }
    var source = y;
    for (var step = 0u; step < height; step++) {
        if step <= y && filled[y - step] == 1u {
            source = y - step;
            break;
        }
        if y + step < height && filled[y + step] == 1u {
            source = y + step;
            break;
        }
    }
    sources[y] = source;
}
