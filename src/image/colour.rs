//! Disparity maps for the eye.

use super::Plane;

type Rgb = [u8; 3];

const BLACK: Rgb = [0, 0, 0];
const WHITE: Rgb = [255, 255, 255];

/// Stops of the colour map at equal steps, far to near: from cold to warm, with lightness rising to the middle
/// and falling after it, and nowhere as dark as the black of invalid pixels.
const STOPS: [Rgb; 9] = [
    [66, 44, 122],
    [70, 107, 227],
    [40, 187, 236],
    [49, 242, 153],
    [162, 252, 60],
    [237, 208, 58],
    [251, 128, 34],
    [214, 54, 10],
    [150, 14, 6],
];

/// Digits 0 to 9, minus and point: five rows of three pixels, the leftmost in the highest bit.
const GLYPHS: [[u8; 5]; 12] = [
    [7, 5, 5, 5, 7],
    [2, 6, 2, 2, 7],
    [7, 1, 7, 4, 7],
    [7, 1, 7, 1, 7],
    [5, 5, 7, 1, 1],
    [7, 4, 7, 1, 7],
    [7, 4, 7, 5, 7],
    [7, 1, 1, 1, 1],
    [7, 5, 7, 5, 7],
    [7, 5, 7, 1, 7],
    [0, 0, 7, 0, 0],
    [0, 0, 0, 0, 2],
];

/// A disparity map in colours, near (large disparity) warm and far cold, with a scale bar below it.
///
/// Colours run from `min` to `max` (pixels of disparity); values beyond take the colour of the nearer end, and
/// what is not finite is black. The result is as wide as the map, and higher by the bar: 16 rows, or more for
/// maps from 400 pixels wide.
#[must_use]
pub fn preview(map: &Plane<f32>, min: f32, max: f32) -> Plane<[u8; 3]> {
    let (w, h) = map.size();
    let (min, max) = (min as f64, max as f64);
    // Rows of text below a large picture grow with it, or they vanish when the picture is scaled down.
    let s = (w / 200).clamp(1, 16);
    let mut picture = Plane::filled(w, h + 16 * s, BLACK);
    for (out, &d) in picture.data_mut().iter_mut().zip(map.data()) {
        if d.is_finite() {
            *out = colour((d as f64 - min) / (max - min));
        }
    }
    if w == 0 {
        return picture;
    }

    let last = (w - 1).max(1) as f64;
    let ramp = h + s;
    fill(&mut picture, 0, ramp, w, 6 * s, |x| colour(x as f64 / last));
    for (value, text) in ticks(min, max, w, s) {
        let x = ((value - min) / (max - min) * (w - 1) as f64).round() as usize;
        fill(&mut picture, x.saturating_sub(s / 2), ramp + 6 * s, s, 2 * s, |_| WHITE);
        let left = x.saturating_sub(text_width(&text, s) / 2).min(w.saturating_sub(text_width(&text, s)));
        write(&mut picture, left, ramp + 9 * s, &text, s);
    }
    picture
}

/// Colour of the position `t` between far (0) and near (1); anything else goes to the nearer end, and what is
/// no number (an empty range) to the middle.
fn colour(t: f64) -> Rgb {
    let t = if t.is_nan() { 0.5 } else { t.clamp(0.0, 1.0) } * (STOPS.len() - 1) as f64;
    let i = (t as usize).min(STOPS.len() - 2);
    let part = t - i as f64;
    [0, 1, 2].map(|c| (STOPS[i][c] as f64 * (1.0 - part) + STOPS[i + 1][c] as f64 * part).round() as u8)
}

/// Values to mark on the scale and their numbers: as many round ones as fit without touching.
fn ticks(min: f64, max: f64, width: usize, s: usize) -> Vec<(f64, String)> {
    let range = max - min;
    if !(range.is_finite() && range > 0.0) {
        return Vec::new();
    }
    for wanted in (1..=10).rev() {
        let (step, decimals) = round_step(range / wanted as f64);
        let first = (min / step).ceil();
        let ticks: Vec<_> = (0..=10)
            .map(|k| (first + k as f64) * step)
            .take_while(|v| *v <= max)
            // The sum turns -0 into 0.
            .map(|v| (v, format!("{:.decimals$}", v + 0.0)))
            .collect();
        let widest = ticks.iter().map(|(_, text)| text_width(text, s)).max().unwrap_or(width + 1);
        let spacing = step / range * (width - 1) as f64;
        if widest <= width && (ticks.len() < 2 || (widest + 2 * s) as f64 <= spacing) {
            return ticks;
        }
    }
    Vec::new()
}

/// The least of 1, 2 and 5 times a power of ten that is not below `least`, and the decimals it needs.
fn round_step(least: f64) -> (f64, usize) {
    let (mut power, mut decimals) = (1.0, 0);
    while power * 10.0 <= least {
        power *= 10.0;
    }
    while power > least && decimals < 40 {
        decimals += 1;
        power = 10.0_f64.powi(-(decimals as i32));
    }
    let step = [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|v| *v >= least);
    match step {
        Some(step) => (step, decimals),
        None => (10.0 * power, decimals.saturating_sub(1)),
    }
}

/// Width of a number in pixels.
fn text_width(text: &str, s: usize) -> usize {
    (4 * text.len()).saturating_sub(1) * s
}

/// Writes a number with its top left corner at (left, top).
fn write(picture: &mut Plane<Rgb>, left: usize, top: usize, text: &str, s: usize) {
    for (i, c) in text.bytes().enumerate() {
        let glyph = match c {
            b'0'..=b'9' => GLYPHS[(c - b'0') as usize],
            b'-' => GLYPHS[10],
            _ => GLYPHS[11],
        };
        for (y, row) in glyph.into_iter().enumerate() {
            for x in (0..3).filter(|x| row & (4 >> x) != 0) {
                fill(picture, left + (4 * i + x) * s, top + y * s, s, s, |_| WHITE);
            }
        }
    }
}

/// Fills the part of a rectangle that lies inside the picture; the colour depends on the column.
fn fill(picture: &mut Plane<Rgb>, x: usize, y: usize, w: usize, h: usize, f: impl Fn(usize) -> Rgb) {
    for y in y..(y + h).min(picture.height()) {
        for x in x..(x + w).min(picture.width()) {
            picture[(x, y)] = f(x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_warm_far_is_cold_and_invalid_black() {
        let map = Plane::new(4, 1, vec![0.0, 64.0, f32::INFINITY, f32::NAN]);
        let picture = preview(&map, 0.0, 64.0);
        let [far, near, infinite, nan] = [0, 1, 2, 3].map(|x| picture[(x, 0)]);
        assert!(far[2] > far[0] && near[0] > near[2]);
        assert_eq!((infinite, nan), (BLACK, BLACK));
    }

    #[test]
    fn values_beyond_the_range_take_the_colour_of_its_end() {
        let map = Plane::new(4, 1, vec![-1e30, 2.0, 5.0, 1e30]);
        let picture = preview(&map, 2.0, 5.0);
        assert_eq!(picture[(0, 0)], picture[(1, 0)]);
        assert_eq!(picture[(3, 0)], picture[(2, 0)]);
    }

    #[test]
    fn no_valid_colour_is_near_black_and_neighbours_differ_little() {
        for i in 0..=1000 {
            let c = colour(i as f64 / 1000.0);
            assert!(c.iter().map(|v| *v as u32).sum::<u32>() > 150, "{i}: {c:?}");
            let next = colour((i + 1) as f64 / 1000.0);
            assert!(c.iter().zip(next).all(|(a, b)| a.abs_diff(b) <= 2), "{i}");
        }
    }

    #[test]
    fn no_size_and_no_range_panics() {
        let values =
            [0.0, -0.0, 1.0, 1e-30, f32::MIN, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 64.0];
        for (w, h) in [(0, 0), (0, 3), (3, 0), (1, 1), (1, 9), (2, 1), (59, 2), (60, 1), (401, 3), (4000, 1)]
        {
            for min in values {
                for max in values {
                    let picture = preview(&Plane::filled(w, h, 7.0), min, max);
                    assert_eq!(picture.width(), w);
                    assert!(picture.height() > h);
                }
            }
        }
    }

    #[test]
    fn ticks_are_round_apart_and_inside() {
        for (min, max) in [(0.0, 63.0), (0.0, 255.0), (-40.0, 40.0), (0.0, 1.0), (31.0, 257.0), (3.0, 3.5)] {
            for width in [60, 64, 100, 450, 1000, 3000] {
                let s = (width / 200).clamp(1, 16);
                let ticks = ticks(min, max, width, s);
                assert!(ticks.len() >= 2, "{min}..{max} at {width}: {ticks:?}");
                for (value, text) in &ticks {
                    assert!((text.parse::<f64>().unwrap() - value).abs() < 1e-9, "{ticks:?}");
                    assert!(*value >= min && *value <= max);
                }
            }
        }
        let texts: Vec<_> = ticks(0.0, 255.0, 400, 1).into_iter().map(|t| t.1).collect();
        assert_eq!(texts, ["0", "50", "100", "150", "200", "250"]);
        assert_eq!(round_step(0.15), (0.2, 1));
        assert_eq!(round_step(0.7), (1.0, 0));
    }

    #[test]
    fn numbers_are_drawn_as_their_glyphs() {
        let mut picture = Plane::filled(12, 6, BLACK);
        write(&mut picture, 0, 0, "-1", 1);
        let drawn: Vec<String> = (0..5)
            .map(|y| (0..7).map(|x| if picture[(x, y)] == WHITE { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(
            drawn,
            [
                ".....".to_owned() + "#.",
                "....##.".into(),
                "###..#.".into(),
                ".....#.".into(),
                "....###".into()
            ]
        );
    }
}
