// Joins the regions on the two sides of borders: between the segments of a row, or between blocks of rows. One invocation
// a pixel at such a border.

// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> parents: array<atomic<u32>>;

fn root(start: u32) -> u32 {
    var here = start;
    var next = atomicLoad(&parents[here]);
    while next != here {
        here = next;
        next = atomicLoad(&parents[here]);
    }
    return here;
}

// Whether two neighbours are in a region, and in the same one.
fn connected(a: u32, b: u32) -> bool {
    if atomicLoad(&parents[a]) == NOWHERE || atomicLoad(&parents[b]) == NOWHERE {
        return false;
    }
    return abs(i32(optima[a].x & 0xffffu) - i32(optima[b].x & 0xffffu)) <= 1;
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let across = params.span == 0u;
    let x = select(params.first_column + id.x, SEGMENT * (id.x + 1u), across);
    let y = select(params.span * (2u * id.y + 1u), id.y, across);
    if x >= params.level.width || y >= params.rows || (!across && id.x >= params.columns) {
        return;
    }
    let here = y * params.level.pixel_pitch + x;
    let other = here - select(params.level.pixel_pitch, 1u, across);
    if !connected(here, other) {
        return;
    }
    // Where the pixels before are joined in the same way, they see to it.
    if !across && id.x > 0u
        && atomicLoad(&parents[here - 1u]) == atomicLoad(&parents[here])
        && atomicLoad(&parents[other - 1u]) == atomicLoad(&parents[other])
        && connected(here - 1u, other - 1u) {
        return;
    }
    var a = root(here);
    var b = root(other);
    while a != b {
        let larger = max(a, b);
        let smaller = min(a, b);
        let before = atomicMin(&parents[larger], smaller);
        if before == larger {
            return;
        }
        // Somebody else had given it a parent: those two belong together as well.
        a = root(before);
        b = root(smaller);
    }
}
