// Weighted median of the disparities around every pixel. One invocation per pixel.

#import band weighted_median

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    if id.x < params.level.width && id.y < params.band.rows {
        next_disparity[id.y * params.level.pixel_pitch + id.x] = median(window(id), 0u);
    }
}
