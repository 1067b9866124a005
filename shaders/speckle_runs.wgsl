// Runs of connected pixels within segments of a row. One invocation a segment.

// label | best << 16, runner-up.
@group(0) @binding(1) var<storage, read> optima: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read_write> parents: array<u32>;
// At the first pixel of a run its length, elsewhere 0.
@group(0) @binding(4) var<storage, read_write> sizes: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let start = id.x * SEGMENT;
    if start >= params.level.width || id.y >= params.rows {
        return;
    }
    let row = id.y * params.level.pixel_pitch;
    var run = NOWHERE;
    var last = 0;
    for (var x = start; x < min(start + SEGMENT, params.level.width); x++) {
        let here = row + x;
        sizes[here] = 0u;
        if (flags[here] & VALIDITY) != 0u {
            run = NOWHERE;
        } else {
            let label = i32(optima[here].x & 0xffffu);
            if run == NOWHERE || abs(label - last) > 1 {
                run = here;
            }
            sizes[run] += 1u;
            last = label;
        }
        parents[here] = run;
    }
}
