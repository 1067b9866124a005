// Beliefs: evidence plus all messages. One invocation per pixel and block of 16 labels.

#import band volume windows messages sections

struct Params {
    level: Level,
    @align(16) band: Band,
    // Largest belief; larger sums saturate at it.
    most: u32,
    // Whether the dependency factors have sent messages.
    sent: u32,
    // Whether there are messages from above and below.
    has_down: u32,
    has_up: u32,
}

@group(0) @binding(1) var<storage, read> evidence: array<u32>;
@group(0) @binding(2) var<storage, read> dependency: array<Quad>;
// Codes of the neighbours, four per word.
@group(0) @binding(3) var<storage, read> members: array<u32>;
// A bit for each factor that holds the pixel, by its offset from the pixel.
@group(0) @binding(4) var<storage, read> incoming: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> down: array<Quad>;
@group(0) @binding(6) var<storage, read> up: array<Quad>;
@group(0) @binding(7) var<storage, read_write> belief: array<Quad>;
@group(0) @binding(8) var<storage, read> windows: array<u32>;

const CENTRE: u32 = WINDOW * WINDOW / 2u;
// Words of codes per factor.
const MEMBER_WORDS: u32 = (SLOTS + 2u) / 4u;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    let quads = params.level.quads;
    let blocks = quads / QUADS;
    let width = params.level.width;
    let block = id.x / width;
    let x = id.x - block * width;
    let first = block * QUADS;
    if block >= blocks || id.y >= params.band.rows {
        return;
    }
    let y = params.band.first_row + id.y;
    let window = window_of(x, y);
    let own = quads_of(window);
    if first + QUADS <= own.x || first >= own.y {
        return;
    }
    let row = params.band.volume_at + id.y * params.level.pitch;
    var sums: array<vec4<u32>, QUADS>;
    for (var i = 0u; i < QUADS; i++) {
        let at = row + place_of(first + i, x);
        sums[i] = unpack_narrow(evidence[at]);
        if params.has_down == 1u {
            sums[i] += unpack(down[at]);
        }
        if params.has_up == 1u {
            sums[i] += unpack(up[at]);
        }
    }
    let top = halo_start(RADIUS);
    var factors = vec2(1u << CENTRE, 0u);
    if SLOTS > 1u {
        factors = incoming[params.level.incoming_at + id.y * params.level.pixel_pitch + x];
    }
    factors *= params.sent;
    while (factors.x | factors.y) != 0u {
        let is_low = factors.x != 0u;
        let code = firstTrailingBit(select(factors.y, factors.x, is_low)) + select(32u, 0u, is_low);
        factors &= select(vec2(0u, factors.y - 1u), vec2(factors.x - 1u, factors.y), is_low);
        let fx = x + code % WINDOW - RADIUS;
        let fy = y + code / WINDOW - RADIUS - top;
        // The pixel is at the opposite offset from the factor. Without its code in a slot, it is slot 0, the own pixel.
        let opposite = vec4(2u * CENTRE - code);
        var slots = vec4<u32>();
        let words = params.level.members_at + fy * params.level.member_pitch + fx * MEMBER_WORDS;
        for (var word = 0u; word < MEMBER_WORDS; word++) {
            let codes = unpack_narrow(members[words + word]);
            slots += select(vec4<u32>(), vec4(4u * word) + vec4(1u, 2u, 3u, 4u), codes == opposite);
        }
        let slot = slots.x + slots.y + slots.z + slots.w;
        let message = params.band.dependency_at + fy * params.level.dependency_pitch
            + place_of(slot * quads + first, fx);
        for (var i = 0u; i < QUADS; i++) {
            sums[i] += unpack(dependency[message + i * width]);
        }
    }
    for (var i = 0u; i < QUADS; i++) {
        let sum = min(sums[i], vec4(params.most));
        belief[row + place_of(first + i, x)] = pack(select(vec4(MOST), sum, are_in(window, first + i)));
    }
}
