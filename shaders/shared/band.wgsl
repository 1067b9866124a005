// What every stage is told first, one block for each dispatch: the level it works on, and the band of rows. Rows of every
// volume start at a multiple of 256 bytes, so that any range of rows can be bound; pitches are in 32-bit words.

struct Level {
    width: u32,
    height: u32,
    // Smallest label.
    low: i32,
    labels: u32,
    // Labels with padding, in quads of four.
    quads: u32,
    // Words in a row of a volume of 8-bit values, one a label; 16-bit ones take twice as many.
    pitch: u32,
    // The same of dependency messages.
    dependency_pitch: u32,
    // Words in a row of member codes.
    member_pitch: u32,
    // Elements in a row of what has one element a pixel.
    pixel_pitch: u32,
    // Words in a row of the starts of the transposed table.
    starts_pitch: u32,
}

// The stage works on rows first_row .. first_row + rows of the level.
struct Band {
    first_row: u32,
    rows: u32,
    // Workgroups that make up a row, and workgroups of the dispatch in x.
    row_groups: u32,
    grid: u32,
}

// Column and row of an invocation. Rows follow each other in workgroups that fold where a dispatch allows no more of
// them in one dimension.
fn place(group: vec3<u32>, lane: u32) -> vec2<u32> {
    let linear = group.x + group.y * params.band.grid;
    let row = linear / params.band.row_groups;
    return vec2((linear - row * params.band.row_groups) * GROUP + lane, row);
}

// Rows that a stage reads above its band start here.
fn halo_start(halo: u32) -> u32 {
    return max(params.band.first_row, halo) - halo;
}
