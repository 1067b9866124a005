// Flags the pixels of small regions. One invocation a pixel of the band.

@group(0) @binding(1) var<storage, read> parents: array<u32>;
@group(0) @binding(2) var<storage, read> sizes: array<u32>;
@group(0) @binding(3) var<storage, read_write> flags: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let pitch = params.level.pixel_pitch;
    let seen = params.first_row + id.y - halo_start(params.halo);
    let root = parents[seen * pitch + id.x];
    if root != NOWHERE && sizes[root] < params.speckle_size {
        flags[id.y * pitch + id.x] |= SPECKLE;
    }
}
