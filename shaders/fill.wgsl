// The farther of the two nearest valid disparities for what is invalid. One invocation a pixel; those whose row takes its
// values from outside the source rows have another dispatch.

@group(0) @binding(1) var<storage, read> disparity: array<i32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> source_disparity: array<i32>;
@group(0) @binding(4) var<storage, read> source_flags: array<u32>;
@group(0) @binding(5) var<storage, read> sources: array<u32>;
@group(0) @binding(6) var<storage, read_write> filled_disparity: array<i32>;
@group(0) @binding(7) var<storage, read_write> filled_flags: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.rows {
        return;
    }
    let source = sources[params.first_row + id.y];
    if source < params.source_first_row || source >= params.source_first_row + params.source_rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    var value = disparity[at];
    var validity = flags[at];
    if !is_valid(validity) && (validity & MASKED) == 0u {
        let row = (source - params.source_first_row) * params.level.pixel_pitch;
        // One beyond the nearest valid pixel to the left, and the nearest to the right.
        var left = id.x + 1u;
        while left > 0u && !is_valid(source_flags[row + left - 1u]) {
            left--;
        }
        var right = id.x;
        while right < params.level.width && !is_valid(source_flags[row + right]) {
            right++;
        }
        if left > 0u || right < params.level.width {
            value = 0x7fffffff;
            if left > 0u {
                value = source_disparity[row + left - 1u];
            }
            if right < params.level.width {
                value = min(value, source_disparity[row + right]);
            }
            validity |= FILLED;
        }
    }
    filled_disparity[at] = value;
    filled_flags[at] = validity;
}
