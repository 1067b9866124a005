use super::binomial;
use mrfgs::image::{Image, Plane};
use mrfgs::low_level::plan::Plan;

/// Codes of the neighbours of every factor of every level, in the layout of `LevelGraph`.
pub fn graphs(image: &Image, plan: &Plan) -> Vec<Vec<u8>> {
    let mut level = image.clone();
    let mut out = Vec::new();
    for z in 0..plan.levels.len() {
        if z > 0 {
            level = downsample(&level);
        }
        out.push(codes(&level, plan));
    }
    out
}

/// Squared colour difference, channel by channel in whole quarters of an 8-bit level.
fn colour_distance(a: [u16; 4], b: [u16; 4]) -> i64 {
    (0..3)
        .map(|c| {
            let quarters = (i64::from(a[c]) - i64::from(b[c])).abs() / 64;
            quarters * quarters
        })
        .sum()
}

fn codes(image: &Image, plan: &Plan) -> Vec<u8> {
    let (width, height) = (image.width() as i64, image.height() as i64);
    // exp(-r^2 / 2 sd^2 - c^2 / 2 sr^2) grows as c^2 + (sr / sd)^2 r^2 shrinks; c is in quarters of an 8-bit
    // level, and the range 0 to 1 has 1020 of these.
    let ratio = plan.method.graph.sigma_range * 1020.0 / plan.method.graph.sigma_space;
    let weight = (ratio * ratio).round().min(f64::from(1 << 20)) as i64;
    let mut out = Vec::new();
    for y in 0..height {
        for x in 0..width {
            // (exponent, squared distance, code): the sort keys of neighbours.
            let mut around = Vec::new();
            for code in 0..49 {
                let (dx, dy) = (code % 7 - 3, code / 7 - 3);
                let (nx, ny) = (x + dx, y + dy);
                let inside = nx >= 0 && ny >= 0 && nx < width && ny < height;
                if (dx, dy) == (0, 0) || !inside || image.masked[(nx as usize, ny as usize)] {
                    continue;
                }
                let centre = image.pixels[(x as usize, y as usize)];
                let colour = colour_distance(centre, image.pixels[(nx as usize, ny as usize)]);
                let distance = dx * dx + dy * dy;
                around.push((colour + weight * distance, distance, code));
            }
            around.sort_unstable();
            if image.masked[(x as usize, y as usize)] {
                around.clear();
            }
            for slot in 0..plan.neighbours {
                out.push(around.get(slot).map_or(255, |n| n.2 as u8));
            }
        }
    }
    out
}

/// The next coarser image.
pub fn downsample(image: &Image) -> Image {
    let (width, height) = (image.width() as i64, image.height() as i64);
    let (w, h) = (image.width().div_ceil(2), image.height().div_ceil(2));
    let masked = Plane::from_fn(w, h, |x, y| {
        let mut all = true;
        for (fx, fy) in [(2 * x, 2 * y), (2 * x + 1, 2 * y), (2 * x, 2 * y + 1), (2 * x + 1, 2 * y + 1)] {
            if fx < image.width() && fy < image.height() {
                all &= image.masked[(fx, fy)];
            }
        }
        all
    });
    let pixels = Plane::from_fn(w, h, |x, y| {
        if masked[(x, y)] {
            return [0; 4];
        }
        let mut out = [0; 4];
        for (channel, out) in out.iter_mut().enumerate() {
            let (mut sum, mut total) = (0, 0);
            for j in -2..=2 {
                for i in -2..=2 {
                    let fx = (2 * x as i64 + i).max(0).min(width - 1) as usize;
                    let fy = (2 * y as i64 + j).max(0).min(height - 1) as usize;
                    if !image.masked[(fx, fy)] {
                        sum += binomial(i) * binomial(j) * i64::from(image.pixels[(fx, fy)][channel]);
                        total += binomial(i) * binomial(j);
                    }
                }
            }
            // Rounded to nearest, ties up.
            *out = ((2 * sum + total) / (2 * total)) as u16;
        }
        out
    });
    Image { pixels, masked }
}
