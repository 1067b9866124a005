// Beliefs: evidence plus all messages. One invocation a pixel and block of 16 labels.

@group(0) @binding(1) var<storage, read> evidence: array<u32>;
@group(0) @binding(2) var<storage, read> dependency: array<u32>;
// Where each pixel's entries start in the transposed table, and one more a row.
@group(0) @binding(3) var<storage, read> starts: array<u32>;
// The slots that hold a pixel: dx + 3 | (dy + 3) << 3 | slot << 6 of the factor at (dx, dy) from it.
@group(0) @binding(4) var<storage, read> incoming: array<u32>;
@group(0) @binding(5) var<storage, read> down: array<u32>;
@group(0) @binding(6) var<storage, read> up: array<u32>;
@group(0) @binding(7) var<storage, read_write> belief: array<vec2<u32>>;

const RADIUS: u32 = 3u;
const QUADS: u32 = 4u;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let quads = params.level.quads;
    let blocks = quads / QUADS;
    let x = id.x / blocks;
    let first = (id.x - x * blocks) * QUADS;
    if x >= params.level.width || id.y >= params.rows {
        return;
    }
    let at = id.y * params.level.pitch + x * quads + first;
    var sums: array<vec4<u32>, QUADS>;
    for (var i = 0u; i < QUADS; i++) {
        sums[i] = unpack_narrow(evidence[at + i]);
        if HAS_DOWN {
            if NARROW {
                sums[i] += unpack_narrow(down[at + i]);
            } else {
                sums[i] += unpack_wide(vec2(down[2u * (at + i)], down[2u * (at + i) + 1u]));
            }
        }
        if HAS_UP {
            if NARROW {
                sums[i] += unpack_narrow(up[at + i]);
            } else {
                sums[i] += unpack_wide(vec2(up[2u * (at + i)], up[2u * (at + i) + 1u]));
            }
        }
    }
    let y = params.first_row + id.y;
    let top = halo_start(RADIUS);
    let start = id.y * params.level.starts_pitch + x;
    // The bound entries are those of the bound rows.
    let end = starts[start + 1u] - starts[0];
    for (var e = starts[start] - starts[0]; e < end; e++) {
        let entry = incoming[e];
        let fx = x + (entry & 7u) - RADIUS;
        let fy = y + ((entry >> 3u) & 7u) - RADIUS - top;
        let quad = (fx * SLOTS + (entry >> 6u)) * quads + first;
        for (var i = 0u; i < QUADS; i++) {
            if NARROW {
                sums[i] += unpack_narrow(dependency[fy * params.level.dependency_pitch + quad + i]);
            } else {
                let word = fy * params.level.dependency_pitch + 2u * (quad + i);
                sums[i] += unpack_wide(vec2(dependency[word], dependency[word + 1u]));
            }
        }
    }
    for (var i = 0u; i < QUADS; i++) {
        belief[at + i] = pack_wide(sums[i]);
    }
}
