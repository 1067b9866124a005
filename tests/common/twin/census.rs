use mrfgs::image::Image;

/// For each pixel, whether each other pixel of its 9 x 7 window is darker.
pub fn census(image: &Image) -> Vec<Vec<bool>> {
    let (width, height) = (image.width() as i64, image.height() as i64);
    let mut out = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let centre = image.pixels[(x as usize, y as usize)][3];
            let mut bits = Vec::new();
            for dy in -3..=3 {
                for dx in -4..=4 {
                    if dx == 0 && dy == 0 {
                        continue;
                    }
                    let nx = (x + dx).max(0).min(width - 1) as usize;
                    let ny = (y + dy).max(0).min(height - 1) as usize;
                    bits.push(!image.masked[(nx, ny)] && image.pixels[(nx, ny)][3] < centre);
                }
            }
            out.push(bits);
        }
    }
    out
}
