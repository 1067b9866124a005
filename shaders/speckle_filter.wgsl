// Flags ties, and small regions of the other pixels: `runs`, then `join` and `flatten` alternately, then `count` and `flag`.
//
// Regions are found by union-find (after Playne and Hawick 2018). Every pixel of a region points to a smaller
// position in it; the root points to itself. First the segments of each row are divided into runs. Then the
// segments of a row are joined, then ever larger blocks of rows. After each step all pointers are flattened,
// to point directly to their roots. A step joins a few blocks along their borders, so chains are no longer
// than the pixels on both sides, which bounds the loops.
//
// Positions count from the first row that the stage reads: the band, and as many rows around it as make a
// region large.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // Rows around the band that the stage reads.
    halo: u32,
    // Rows per block to join, or 0 to join the segments of each row; number of blocks that become one; and
    // the columns to join them in.
    span: u32,
    blocks: u32,
    first_column: u32,
    columns: u32,
    // Regions with fewer pixels are small.
    size: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read_write> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> parents: array<atomic<u32>>;
// The length of a run at its first pixel, elsewhere 0; finally the number of pixels of a region at its root.
@group(0) @binding(4) var<storage, read_write> sizes: array<atomic<u32>>;

// Parent of pixels without a region.
const NOWHERE: u32 = 0xffffffffu;

// Whether the runner-up is as good as the best label.
fn tie(at: u32) -> bool {
    return optima[at].x >> 16u == optima[at].y;
}

// Runs of connected pixels within segments of a row. One invocation per segment.
@compute @workgroup_size(GROUP)
fn runs(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let start = id.x * SEGMENT;
    if start >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    var run = NOWHERE;
    var length = 0u;
    var last = 0;
    for (var x = start; x < min(start + SEGMENT, params.level.width); x++) {
        let here = row + x;
        atomicStore(&sizes[here], 0u);
        if (flags[here] & VALIDITY) != 0u || tie(here) {
            run = NOWHERE;
        } else {
            let label = i32(optima[here].x & 0xffffu);
            if run == NOWHERE || abs(label - last) > 1 {
                run = here;
                length = 0u;
            }
            length++;
            atomicStore(&sizes[run], length);
            last = label;
        }
        atomicStore(&parents[here], run);
    }
}

// The root of the region that contains the pixel at `start`.
fn root(start: u32) -> u32 {
    var here = start;
    var next = atomicLoad(&parents[here]);
    while next != here {
        here = next;
        next = atomicLoad(&parents[here]);
    }
    return here;
}

// Whether two neighbours belong to one region.
fn connected(a: u32, b: u32) -> bool {
    if atomicLoad(&parents[a]) == NOWHERE || atomicLoad(&parents[b]) == NOWHERE {
        return false;
    }
    return abs(i32(optima[a].x & 0xffffu) - i32(optima[b].x & 0xffffu)) <= 1;
}

// Joins the regions on both sides of borders: between segments of a row, or between blocks of rows. One
// invocation per pixel at a border.
@compute @workgroup_size(GROUP)
fn join(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let across = params.span == 0u;
    let x = select(params.first_column + id.x, SEGMENT * (id.x + 1u), across);
    // There is one border less than blocks.
    let block = id.y / (params.blocks - 1u) * params.blocks + id.y % (params.blocks - 1u) + 1u;
    let y = select(params.span * block, id.y, across);
    if x >= params.level.width || y >= params.band.rows || (!across && id.x >= params.columns) {
        return;
    }
    let here = y * params.level.pixel_pitch + x;
    let other = here - select(params.level.pixel_pitch, 1u, across);
    if !connected(here, other) {
        return;
    }
    // If the previous pixels are connected in the same way, their invocation joins these too.
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
        // Another invocation has changed the parent: these two belong together as well.
        a = root(before);
        b = root(smaller);
    }
}

// Points every pixel to its root. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn flatten(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let start = id.y * params.level.pixel_pitch + id.x;
    let parent = atomicLoad(&parents[start]);
    if parent != NOWHERE {
        // Roots stay roots, so other invocations reach the root by the old or the new pointer.
        atomicStore(&parents[start], root(parent));
    }
}

// Adds the lengths of all runs to the sizes at their roots. One invocation per pixel.
@compute @workgroup_size(GROUP)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let here = id.y * params.level.pixel_pitch + id.x;
    let to = atomicLoad(&parents[here]);
    // Roots start a run and already have its length; other runs are added to them.
    if to != NOWHERE && to != here {
        let length = atomicLoad(&sizes[here]);
        if length > 0u {
            atomicAdd(&sizes[to], length);
        }
    }
}

// Flags ties and the pixels of small regions. One invocation per pixel of the band.
@compute @workgroup_size(GROUP)
fn flag(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let pitch = params.level.pixel_pitch;
    let seen = params.band.first_row + id.y - halo_start(params.halo);
    let here = id.y * pitch + id.x;
    let at = atomicLoad(&parents[seen * pitch + id.x]);
    if at != NOWHERE {
        if atomicLoad(&sizes[at]) < params.size {
            flags[here] |= SPECKLE;
        }
    } else if (flags[here] & VALIDITY) == 0u && tie(here) {
        flags[here] |= TIE;
    }
}
