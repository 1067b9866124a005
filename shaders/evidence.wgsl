// Evidence from costs, and the initial beliefs. One invocation per pixel.

#import band volume windows messages

struct Params {
    level: Level,
    @align(16) band: Band,
    multiplier: u32,
    limit: u32,
    up: u32,
    down: u32,
    cap: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// 8-bit at level 0, 16-bit at coarser levels.
@group(0) @binding(1) var<storage, read> cost: array<u32>;
@group(0) @binding(2) var<storage, read_write> evidence: array<u32>;
@group(0) @binding(3) var<storage, read_write> belief: array<Quad>;
@group(0) @binding(4) var<storage, read> windows: array<u32>;

// Costs of a quad in 1/256 cost units.
fn load_cost(row: u32, index: u32) -> vec4<u32> {
    var c: vec4<u32>;
    if FINE_NARROW {
        c = unpack_narrow(cost[row + index]) << vec4(COST_FRACTION_BITS);
    } else {
        c = unpack_wide(vec2(cost[row + 2u * index], cost[row + 2u * index + 1u]));
    }
    return c;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let quads = params.level.quads;
    let pitch = params.level.pitch;
    let row = id.y * select(2u * pitch, pitch, FINE_NARROW);
    let window = window_of(id.x, params.band.first_row + id.y);
    let own = quads_of(window);
    var least = vec4(1u << 16u);
    for (var quad = own.x; quad < own.y; quad++) {
        let c = load_cost(row, place_of(quad, id.x));
        least = min(least, select(vec4(1u << 16u), c, are_in(window, quad)));
    }
    let base = vec4(smallest(least));
    for (var quad = 0u; quad < quads; quad++) {
        let index = place_of(quad, id.x);
        if quad < own.x || quad >= own.y {
            belief[id.y * pitch + index] = pack(vec4(MOST));
            continue;
        }
        let c = load_cost(row, index);
        let difference = min(max(c, base) - base, vec4(params.limit));
        let product = ((difference << vec4(params.up)) * params.multiplier) >> vec4(16u);
        let scaled = (product + vec4((1u << params.down) >> 1u)) >> vec4(params.down);
        let e = min(scaled, vec4(params.cap));
        evidence[id.y * pitch + index] = pack_narrow(select(vec4(PADDING), e, are_in(window, quad)));
        belief[id.y * pitch + index] = pack(select(vec4(MOST), e, are_in(window, quad)));
    }
}
