// Makes every pixel point at its root. One invocation a pixel.

@group(0) @binding(1) var<storage, read_write> parents: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let start = id.y * params.level.pixel_pitch + id.x;
    var here = atomicLoad(&parents[start]);
    if here == NOWHERE {
        return;
    }
    var next = atomicLoad(&parents[here]);
    while next != here {
        here = next;
        next = atomicLoad(&parents[here]);
    }
    // Roots stay roots meanwhile, so a pointer that others follow leads there whether they see it old or new.
    atomicStore(&parents[start], here);
}
