// Messages of the dependency factors. One invocation per factor. A factor reads old beliefs and its own old
// messages and writes only its own messages, so flooding in place is exact.

#import band volume windows messages sections

struct Params {
    level: Level,
    @align(16) band: Band,
    // Cost of disagreement.
    tau: u32,
    // Cost of labels that differ by one.
    step: u32,
    // Whether the factors have sent messages; until then these are 0, whatever is stored.
    sent: u32,
}

// Codes of the neighbours, four per word.
@group(0) @binding(1) var<storage, read> members: array<u32>;
@group(0) @binding(2) var<storage, read> belief: array<Quad>;
@group(0) @binding(3) var<storage, read_write> dependency: array<Quad>;
@group(0) @binding(4) var<storage, read> windows: array<u32>;

const ABSENT: u32 = 0xffffffffu;

// A member's message to the factor: its belief minus the factor's old message, and minus `least` if
// truncation is absolute; infinite at labels that the member does not have.
fn to_factor(member: u32, message: u32, least: u32) -> vec4<u32> {
    let b = unpack(belief[member]);
    var q = b - unpack(dependency[message]) * params.sent;
    if ABSOLUTE {
        q = max(q, vec4(least)) - vec4(least);
    }
    return select(q, vec4(MOST), b == vec4(MOST));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    enter(group);
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let quads = params.level.quads;
    let y = params.band.first_row + id.y;
    let top = halo_start(RADIUS);
    let width = params.level.width;
    // First quad of the factor's messages, and of each member's belief.
    let own = params.band.dependency_at + id.y * params.level.dependency_pitch + id.x;
    var bases: array<u32, SLOTS>;
    let beliefs = params.band.volume_at;
    bases[0] = beliefs + (y - top) * params.level.pitch + id.x;
    var present = 1u;
    // The labels of any member; messages at other labels are never read.
    var spanned = quads_of(window_of(id.x, y));
    let codes = params.level.members_at + id.y * params.level.member_pitch + id.x * ((SLOTS + 2u) / 4u);
    for (var slot = 1u; slot < SLOTS; slot++) {
        let code = (members[codes + (slot - 1u) / 4u] >> (8u * ((slot - 1u) % 4u))) & 0xffu;
        bases[slot] = ABSENT;
        if code != NO_MEMBER {
            let px = id.x + code % WINDOW - RADIUS;
            let py = y + code / WINDOW - RADIUS;
            bases[slot] = beliefs + (py - top) * params.level.pitch + px;
            present += 1u;
            let theirs = quads_of(window_of(px, py));
            spanned = vec2(min(spanned.x, theirs.x), max(spanned.y, theirs.y));
        }
    }
    if present < 2u {
        // Its messages stay 0.
        for (var quad = spanned.x; quad < spanned.y && params.sent == 0u; quad++) {
            dependency[own + quad * width] = pack(vec4<u32>());
        }
        return;
    }

    // For absolute truncation, subtract the minimum of each member's message to the factor over the labels
    // that the factor's own pixel has.
    var floors: array<u32, SLOTS>;
    if ABSOLUTE {
        for (var slot = 0u; slot < SLOTS; slot++) {
            floors[slot] = 0u;
            if bases[slot] != ABSENT {
                var least = vec4(MOST);
                for (var quad = spanned.x; quad < spanned.y; quad++) {
                    let q = to_factor(bases[slot] + quad * width, own + (slot * quads + quad) * width, 0u);
                    let has = unpack(belief[bases[0] + quad * width]) != vec4(MOST);
                    least = min(least, select(vec4(MOST), q, has));
                }
                floors[slot] = smallest(least);
            }
        }
    }

    // The smallest sum over the other members, for each member.
    var least: array<vec4<u32>, SLOTS>;
    for (var slot = 0u; slot < SLOTS; slot++) {
        least[slot] = vec4(MOST);
    }
    var q: array<vec4<u32>, SLOTS>;
    for (var quad = spanned.x; quad < spanned.y; quad++) {
        var total = vec4<u32>();
        for (var slot = 0u; slot < SLOTS; slot++) {
            if bases[slot] != ABSENT {
                q[slot] = to_factor(bases[slot] + quad * width, own + (slot * quads + quad) * width, floors[slot]);
                total += q[slot];
            }
        }
        for (var slot = 0u; slot < SLOTS; slot++) {
            if bases[slot] != ABSENT {
                let sum = select(total - q[slot], vec4(MOST), q[slot] == vec4(MOST));
                least[slot] = min(least[slot], sum);
                if STEPS {
                    dependency[own + (slot * quads + quad) * width] = pack(min(sum, vec4(MOST)));
                }
            }
        }
    }

    var high: array<u32, SLOTS>;
    var low: array<u32, SLOTS>;
    for (var slot = 0u; slot < SLOTS; slot++) {
        let m = smallest(least[slot]);
        low[slot] = select(min(m, MOST - params.tau), 0u, ABSOLUTE);
        high[slot] = low[slot] + params.tau;
    }

    if STEPS {
        // Sums are stored in place of the messages, and infinite at labels that the factor's own pixel or the member does not have.
        for (var slot = 0u; slot < SLOTS; slot++) {
            if bases[slot] != ABSENT {
                var below = MOST;
                var sums = unpack(dependency[own + (slot * quads + spanned.x) * width]);
                for (var quad = spanned.x; quad < spanned.y; quad++) {
                    let to = own + (slot * quads + quad) * width;
                    var next = vec4(MOST);
                    if quad + 1u < spanned.y {
                        next = unpack(dependency[to + width]);
                    }
                    let near = min(vec4(below, sums.xyz), vec4(sums.yzw, next.x)) + vec4(params.step);
                    let has = unpack(belief[bases[0] + quad * width]) != vec4(MOST);
                    let sum = min(min(sums, select(vec4(MOST), near, has)), vec4(high[slot]));
                    dependency[to] = pack(sum - vec4(low[slot]));
                    below = sums.w;
                    sums = next;
                }
            }
        }
        return;
    }

    for (var quad = spanned.x; quad < spanned.y; quad++) {
        var total = vec4<u32>();
        for (var slot = 0u; slot < SLOTS; slot++) {
            if bases[slot] != ABSENT {
                q[slot] = to_factor(bases[slot] + quad * width, own + (slot * quads + quad) * width, floors[slot]);
                total += q[slot];
            }
        }
        for (var slot = 0u; slot < SLOTS; slot++) {
            if bases[slot] != ABSENT {
                let sum = min(total - q[slot], vec4(high[slot]));
                dependency[own + (slot * quads + quad) * width] = pack(sum - vec4(low[slot]));
            }
        }
    }
}
