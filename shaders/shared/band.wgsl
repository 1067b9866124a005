// Parameters at the start of every stage's uniform, per dispatch: its level and its band of rows. Rows of
// every volume start at multiples of 256 bytes, so that any range of rows can be bound. Pitches are in 32-bit
// words.

struct Level {
    width: u32,
    height: u32,
    // Smallest label.
    low: i32,
    labels: u32,
    // Labels with padding, in quads of four.
    quads: u32,
    // Words per row of a volume of 8-bit values, one per label; 16-bit values take twice as many.
    pitch: u32,
    // Words per row of dependency messages, likewise.
    dependency_pitch: u32,
    // Words per row of member codes.
    member_pitch: u32,
    // Elements per row of a map with one element per pixel.
    pixel_pitch: u32,
    // Offsets of its members, its transposed table and its windows in the bindings.
    members_at: u32,
    incoming_at: u32,
    windows_at: u32,
}

// The stage processes rows first_row .. first_row + rows of the level.
struct Band {
    first_row: u32,
    rows: u32,
    // Workgroups per row, and workgroups of the dispatch in x.
    row_groups: u32,
    grid: u32,
    // Its first workgroup, and number of levels in the dispatch.
    first_group: u32,
    sections: u32,
    // Offsets of the volumes of the level, in quads, and of its dependency messages in the bindings.
    volume_at: u32,
    dependency_at: u32,
}

// Column and row of an invocation. Rows follow each other in the workgroups, which wrap at the dispatch limit.
fn place(group: vec3<u32>, lane: u32) -> vec2<u32> {
    let linear = group.x + group.y * params.band.grid - params.band.first_group;
    let row = linear / params.band.row_groups;
    return vec2((linear - row * params.band.row_groups) * GROUP + lane, row);
}

// First bound row, for a stage that reads a halo of `halo` rows above its band.
fn halo_start(halo: u32) -> u32 {
    return max(params.band.first_row, halo) - halo;
}
