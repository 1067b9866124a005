// The parameters that every stage gets first, one block per dispatch: its level and its band of rows. Rows of
// every volume start at a multiple of 256 bytes, so that any range of rows can be bound. Pitches are in
// 32-bit words.

struct Level {
    width: u32,
    height: u32,
    // Smallest label.
    low: i32,
    labels: u32,
    // Labels with padding, in quads of four.
    quads: u32,
    // Words in a row of a volume of 8-bit values, one per label; 16-bit values take twice as many.
    pitch: u32,
    // The same for dependency messages.
    dependency_pitch: u32,
    // Words in a row of member codes.
    member_pitch: u32,
    // Elements in a row of a map with one element per pixel.
    pixel_pitch: u32,
    // Where its members, its transposed table and its windows begin in what is bound.
    members_at: u32,
    incoming_at: u32,
    windows_at: u32,
}

// The stage works on rows first_row .. first_row + rows of the level.
struct Band {
    first_row: u32,
    rows: u32,
    // Workgroups per row, and workgroups of the dispatch in x.
    row_groups: u32,
    grid: u32,
    // Its first workgroup, and how many levels the dispatch goes over.
    first_group: u32,
    sections: u32,
    // Where the volumes of the level, in quads, and its dependency messages begin in what is bound.
    volume_at: u32,
    dependency_at: u32,
}

// Column and row of an invocation. Rows follow each other in the workgroups, which wrap around where a
// dispatch allows no more of them in one dimension.
fn place(group: vec3<u32>, lane: u32) -> vec2<u32> {
    let linear = group.x + group.y * params.band.grid - params.band.first_group;
    let row = linear / params.band.row_groups;
    return vec2((linear - row * params.band.row_groups) * GROUP + lane, row);
}

// First row that is bound, for a stage that reads a halo of this many rows above its band.
fn halo_start(halo: u32) -> u32 {
    return max(params.band.first_row, halo) - halo;
}
