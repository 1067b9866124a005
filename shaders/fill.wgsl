// Fills invalid pixels from the nearest valid ones: `rows` finds the rows with a valid pixel, `sources` the
// row from which each row is filled, and `fill` fills.

#import band maps

struct Params {
    level: Level,
    @align(16) band: Band,
    // The source rows that are bound for `fill`.
    source_first_row: u32,
    source_rows: u32,
    // 1 if the larger of two disparities is the farther one, else 0.
    farther_is_larger: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

@group(0) @binding(1) var<storage, read> disparity: array<i32>;
@group(0) @binding(2) var<storage, read> flags: array<u32>;
@group(0) @binding(3) var<storage, read> source_disparity: array<i32>;
@group(0) @binding(4) var<storage, read> source_flags: array<u32>;
@group(0) @binding(5) var<storage, read_write> next_disparity: array<i32>;
@group(0) @binding(6) var<storage, read_write> next_flags: array<u32>;
// For every row: 1 if it has a valid pixel, else 0; and the row from which it is filled.
@group(0) @binding(7) var<storage, read_write> known_rows: array<u32>;
@group(0) @binding(8) var<storage, read_write> row_sources: array<u32>;

// Whether each row has a valid pixel. One invocation per row.
@compute @workgroup_size(GROUP)
fn rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.band.rows || id.y > 0u {
        return;
    }
    var x = 0u;
    while x < params.level.width && !is_valid(flags[id.x * params.level.pixel_pitch + x]) {
        x++;
    }
    known_rows[params.band.first_row + id.x] = u32(x < params.level.width);
}

// The row from which each row is filled: the nearest with a valid pixel, the upper one of two; the row itself
// if there is none. One invocation per row.
@compute @workgroup_size(GROUP)
fn sources(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let y = id.x;
    let height = params.level.height;
    if y >= height || id.y > 0u {
        return;
    }
    var source = y;
    for (var step = 0u; step < height; step++) {
        if step <= y && known_rows[y - step] == 1u {
            source = y - step;
            break;
        }
        if y + step < height && known_rows[y + step] == 1u {
            source = y + step;
            break;
        }
    }
    row_sources[y] = source;
}

// Fills invalid pixels with the farther of the two nearest valid disparities. One invocation per pixel.
// Pixels with a source row outside the bound ones are filled by another dispatch.
@compute @workgroup_size(GROUP)
fn fill(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x >= params.level.width || id.y >= params.band.rows {
        return;
    }
    let source = row_sources[params.band.first_row + id.y];
    if source < params.source_first_row || source >= params.source_first_row + params.source_rows {
        return;
    }
    let at = id.y * params.level.pixel_pitch + id.x;
    var value = disparity[at];
    var validity = flags[at];
    if !is_valid(validity) && (validity & MASKED) == 0u {
        let row = (source - params.source_first_row) * params.level.pixel_pitch;
        // The column after the nearest valid pixel to the left, and the nearest valid column to the right.
        var left = id.x + 1u;
        while left > 0u && !is_valid(source_flags[row + left - 1u]) {
            left--;
        }
        var right = id.x;
        while right < params.level.width && !is_valid(source_flags[row + right]) {
            right++;
        }
        if left > 0u || right < params.level.width {
            if left > 0u {
                value = source_disparity[row + left - 1u];
            }
            if right < params.level.width {
                let other = source_disparity[row + right];
                if left == 0u || (params.farther_is_larger == 1u) == (other > value) {
                    value = other;
                }
            }
            validity |= FILLED;
        }
    }
    next_disparity[at] = value;
    next_flags[at] = validity;
}
