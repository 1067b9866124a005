// The graph of a level: `downsample` computes the guide from the next finer level, `choose` the members of
// every factor, and `transpose` their transposed table. One invocation per pixel.

#import band volume image sections

struct Params {
    level: Level,
    @align(16) band: Band,
    // Codes of the neighbours, nearest first, four per word.
    ranked: array<vec4<u32>, PLACES / 16u>,
    @align(16) fine: Level,
    // Weight of a squared pixel of distance.
    weight: u32,
    // Offsets of the guide of the level and of the next finer one in the bindings.
    guide_at: u32,
    fine_at: u32,
}

@group(0) @binding(1) var<storage, read> guide: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> next_guide: array<vec4<u32>>;
// Codes of the neighbours, four per word.
@group(0) @binding(3) var<storage, read_write> members_out: array<u32>;
@group(0) @binding(4) var<storage, read> members_in: array<u32>;
// A bit for each factor that holds the pixel, by its offset from the pixel.
@group(0) @binding(5) var<storage, read_write> incoming: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> fine_guide: array<vec4<u32>>;

// Words of codes per factor.
const MEMBER_WORDS: u32 = (NEIGHBOURS + 3u) / 4u;

// The binomial mean over the unmasked pixels around twice (x, y).
@compute @workgroup_size(GROUP)
fn downsample(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let size = vec2<i32>(vec2(params.fine.width, params.fine.height));
    let at = 2 * vec2<i32>(vec2(id.x, params.band.first_row + id.y));
    let top = max(2 * i32(params.band.first_row), 2) - 2;
    var sums = vec3<u32>();
    var total = 0u;
    var unmasked = false;
    for (var j = -2; j <= 2; j++) {
        let row = u32(clamp(at.y + j, 0, size.y - 1) - top) * params.fine.pixel_pitch;
        for (var i = -2; i <= 2; i++) {
            let pixel = fine_guide[params.fine_at + row + u32(clamp(at.x + i, 0, size.x - 1))];
            if pixel.z == 0u {
                // 1, 4, 6, 4, 1 in both directions.
                let w = ((6u >> u32(abs(i))) + u32(i == 1 || i == -1))
                    * ((6u >> u32(abs(j))) + u32(j == 1 || j == -1));
                sums += w * channels(pixel);
                total += w;
                let is_child = (i == 0 || i == 1) && (j == 0 || j == 1);
                unmasked = unmasked || is_child;
            }
        }
    }
    var out = vec4(0u, 0u, 1u, 0u);
    if unmasked {
        let mean = (2u * sums + vec3(total)) / vec3(2u * total);
        out = vec4(mean.x | (mean.y << 16u), mean.z, 0u, 0u);
    }
    next_guide[id.y * params.level.pixel_pitch + id.x] = out;
}

// Keeps the neighbours with the smallest keys, distance << RANK_BITS | rank, in their order.
@compute @workgroup_size(GROUP)
fn choose(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let size = vec2(params.level.width, params.level.height);
    let here = vec2(id.x, params.band.first_row + id.y);
    let top = halo_start(RADIUS);
    let pitch = params.level.pixel_pitch;
    let centre = guide[params.guide_at + (here.y - top) * pitch + id.x];
    let out = params.level.members_at + id.y * params.level.member_pitch + id.x * MEMBER_WORDS;
    // The keys of each pass are above those of the previous pass.
    var last = -1;
    for (var first = 0u; first < NEIGHBOURS; first += CHOSEN) {
        var keys: array<i32, CHOSEN>;
        for (var i = 0u; i < CHOSEN; i++) {
            keys[i] = NO_KEY;
        }
        for (var rank = 0u; rank < PLACES; rank++) {
            let code = code_of(rank);
            let steps = vec2(code % WINDOW, code / WINDOW);
            // Beyond the upper and left borders, this wraps to large numbers.
            let there = here + steps - vec2(RADIUS);
            if all(there < size) {
                let pixel = guide[params.guide_at + (there.y - top) * pitch + there.x];
                if (pixel.z | centre.z) == 0u {
                    let away = vec2<i32>(steps) - vec2(i32(RADIUS));
                    let a = channels(centre);
                    let b = channels(pixel);
                    let colour = (max(a, b) - min(a, b)) >> vec3(6u);
                    let distance = dot(colour, colour) + params.weight * u32(dot(away, away));
                    var key = i32((distance << RANK_BITS) | rank);
                    if key > last {
                        for (var i = 0u; i < CHOSEN; i++) {
                            let smaller = min(keys[i], key);
                            key = max(keys[i], key);
                            keys[i] = smaller;
                        }
                    }
                }
            }
        }
        last = keys[CHOSEN - 1u];
        for (var word = 0u; word < min((CHOSEN + 3u) / 4u, MEMBER_WORDS - first / 4u); word++) {
            var codes = 0u;
            for (var i = 0u; i < 4u; i++) {
                let slot = 4u * word + i;
                var code = NO_MEMBER;
                if slot < CHOSEN && first + slot < NEIGHBOURS {
                    let key = keys[slot];
                    if key != NO_KEY {
                        code = code_of(u32(key) & ((1u << RANK_BITS) - 1u));
                    }
                }
                codes |= code << (8u * i);
            }
            members_out[out + first / 4u + word] = codes;
        }
    }
}

// The code of the neighbour with this rank.
fn code_of(rank: u32) -> u32 {
    return (params.ranked[rank / 16u][(rank / 4u) % 4u] >> (8u * (rank % 4u))) & 0xffu;
}

// Tests for all factors in the window whether they hold the pixel.
@compute @workgroup_size(GROUP)
fn transpose(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let size = vec2(params.level.width, params.level.height);
    let top = halo_start(RADIUS);
    let here = vec2(id.x, params.band.first_row + id.y);
    var factors = vec2<u32>();
    for (var code = 0u; code <= PLACES; code++) {
        let there = here + vec2(code % WINDOW, code / WINDOW) - vec2(RADIUS);
        if all(there < size) {
            // The pixel is at the opposite offset from the factor. Every factor holds its own pixel.
            let opposite = PLACES - code;
            var holds = code == opposite;
            let words = params.level.members_at + (there.y - top) * params.level.member_pitch + there.x * MEMBER_WORDS;
            for (var word = 0u; word < MEMBER_WORDS; word++) {
                let codes = members_in[words + word];
                holds = holds || any(unpack_narrow(codes) == vec4(opposite));
            }
            let bit = u32(holds) << (code % 32u);
            factors |= select(vec2(0u, bit), vec2(bit, 0u), code < 32u);
        }
    }
    incoming[params.level.incoming_at + id.y * params.level.pixel_pitch + id.x] = factors;
}
