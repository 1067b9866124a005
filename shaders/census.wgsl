// Census of every pixel of one image: a bit for each other place of a 9 x 7 window in raster order, set where its
// grey is below the centre's. One invocation a pixel.

@group(0) @binding(1) var<storage, read> image: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> census: array<vec2<u32>>;

const RADIUS_X: i32 = 4;
const RADIUS_Y: i32 = 3;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let id = place(group, lane);
    let width = params.level.width;
    if id.x >= width || id.y >= params.rows {
        return;
    }
    let x = i32(id.x);
    let y = i32(params.first_row + id.y);
    let top = halo_start(u32(RADIUS_Y));
    let pitch = params.level.pixel_pitch;
    let centre = image[(u32(y) - top) * pitch + id.x].y >> 16u;
    var bits = vec2<u32>();
    for (var dy = -RADIUS_Y; dy <= RADIUS_Y; dy++) {
        let row = (u32(clamp(y + dy, 0, i32(params.level.height) - 1)) - top) * pitch;
        for (var dx = -RADIUS_X; dx <= RADIUS_X; dx++) {
            if dx != 0 || dy != 0 {
                let pixel = image[row + u32(clamp(x + dx, 0, i32(width) - 1))];
                let below = (pixel.y >> 16u) < centre && pixel.z == 0u;
                bits = vec2((bits.x << 1u) | u32(below), (bits.y << 1u) | (bits.x >> 31u));
            }
        }
    }
    census[id.y * pitch + id.x] = bits;
}
