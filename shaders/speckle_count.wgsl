// Adds the lengths of all runs to the sizes at their roots. One invocation a pixel.

@group(0) @binding(1) var<storage, read_write> parents: array<u32>;
@group(0) @binding(2) var<storage, read_write> sizes: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let here = id.y * params.level.pixel_pitch + id.x;
    let root = parents[here];
    // Roots begin a run and have its length already; only they are added to.
    if root != NOWHERE && root != here {
        let length = atomicLoad(&sizes[here]);
        if length > 0u {
            atomicAdd(&sizes[root], length);
        }
    }
}
