//! Renders maps as pictures.

use crate::image::Plane;
use crate::maps::{flag, has_disparity};

type Rgb = [u8; 3];

const BLACK: Rgb = [0, 0, 0];
const WHITE: Rgb = [255, 255, 255];
const GREY: Rgb = [128, 128, 128];

/// The colours of a map, from far to near. None is as dark as the black of invalid pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourMap {
    /// From cold to warm, with lightness rising to the middle and falling after it: Google's Turbo (Mikhailov
    /// 2019), with lighter ends.
    #[default]
    Turbo,
    /// From violet to yellow, in even steps of lightness, for the colour-blind and for print in grey:
    /// Matplotlib's (Smith and van der Walt 2015).
    Viridis,
    /// From dark to bright.
    Grey,
}

impl ColourMap {
    /// The colours at equal steps, from far to near.
    fn stops(self) -> &'static [Rgb] {
        match self {
            Self::Turbo => &[
                [66, 44, 122],
                [70, 107, 227],
                [40, 187, 236],
                [49, 242, 153],
                [162, 252, 60],
                [237, 208, 58],
                [251, 128, 34],
                [214, 54, 10],
                [150, 14, 6],
            ],
            Self::Viridis => &[
                [68, 1, 84],
                [71, 45, 123],
                [59, 82, 139],
                [44, 114, 142],
                [33, 145, 140],
                [40, 174, 128],
                [94, 201, 98],
                [173, 220, 48],
                [253, 231, 37],
            ],
            Self::Grey => &[[56; 3], [255; 3]],
        }
    }
}

/// Colours of a signed error in equal steps: both sides are equally dark, and no colour is close to the grey
/// or black of pixels without an error.
const SIGNED: [Rgb; 7] = [
    [16, 48, 120],
    [48, 112, 196],
    [140, 190, 232],
    [250, 250, 250],
    [246, 172, 136],
    [212, 84, 64],
    [122, 14, 36],
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

/// A disparity map in `colours`, with a scale bar below it.
///
/// The colours run from `min` to `max` (pixels of disparity). Values outside take the colour of the nearer
/// end, and values that are not finite are black. The picture is as wide as the map, and higher by the bar:
/// 16 rows, or more for maps at least 400 pixels wide.
#[must_use]
pub fn preview(map: &Plane<f32>, min: f32, max: f32, colours: ColourMap) -> Plane<[u8; 3]> {
    let (min, max) = (min as f64, max as f64);
    let colour = |t| between(colours.stops(), t);
    let pixel = |x, y| {
        let d: f32 = map[(x, y)];
        if d.is_finite() { colour((d as f64 - min) / (max - min)) } else { BLACK }
    };
    with_scale(map.size(), pixel, min, max, colour)
}

/// Two pictures side by side, aligned at the top; black below the shorter one.
#[must_use]
pub fn side_by_side(left: &Plane<[u8; 3]>, right: &Plane<[u8; 3]>) -> Plane<[u8; 3]> {
    let (width, height) = (left.width() + right.width(), left.height().max(right.height()));
    Plane::from_fn(width, height, |x, y| {
        let (picture, x) = if x < left.width() { (left, x) } else { (right, x - left.width()) };
        if y < picture.height() { picture[(x, y)] } else { BLACK }
    })
}

/// The signed error `estimate` - `truth` in colours, with a scale bar below it as in [`preview`]: blue where
/// the estimate is too small (too far), white where it is right, red where it is too large (too near).
///
/// The colours run from -`limit` to `limit` (pixels of disparity), and larger errors take the colour of the
/// nearer end. A pixel with known truth and no estimate is black; a pixel without known truth is grey. In
/// both maps, a value that is not finite counts as missing.
///
/// # Panics
/// When the maps differ in size.
#[must_use]
pub fn error(estimate: &Plane<f32>, truth: &Plane<f32>, limit: f32) -> Plane<[u8; 3]> {
    assert_eq!(estimate.size(), truth.size(), "two maps of one view");
    let limit = limit as f64;
    let pixel = |x, y| match (estimate[(x, y)], truth[(x, y)]) {
        (_, t) if !t.is_finite() => GREY,
        (d, _) if !d.is_finite() => BLACK,
        (d, t) => between(&SIGNED, (d as f64 - t as f64 + limit) / (2.0 * limit)),
    };
    with_scale(truth.size(), pixel, -limit, limit, |t| between(&SIGNED, t))
}

/// Grey levels 0 ..= 255, with a scale bar below them as in [`preview`].
#[must_use]
pub fn grey(levels: &Plane<u8>) -> Plane<[u8; 3]> {
    let ramp = |t: f64| [(255.0 * t).round() as u8; 3];
    with_scale(levels.size(), |x, y| [levels[(x, y)]; 3], 0.0, 255.0, ramp)
}

/// A colour for texture zone `zone`, far from the colours of the next zones.
#[must_use]
pub fn zone(zone: u32) -> [u8; 3] {
    let hash = zone.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    [hash >> 24, hash >> 16 & 0xff, hash >> 8 & 0xff].map(|v| v as u8)
}

/// Classes in the colours of `palette`, which holds the number and the colour of each. The legend below shows
/// the numbers beside their colours, in as many lines as it needs. `class` gives the index into the palette;
/// other indices are black.
#[must_use]
pub fn classes(class: &Plane<usize>, palette: &[(u32, [u8; 3])]) -> Plane<[u8; 3]> {
    let (w, h) = class.size();
    let s = unit(w);
    let entries: Vec<_> = palette.iter().map(|&(number, colour)| (number.to_string(), colour)).collect();
    // A swatch of 5 x 5, a gap of 2, the number, a gap of 5.
    let widest = entries.iter().map(|(text, _)| (7 * s) + text_width(text, s) + 5 * s).max().unwrap_or(1);
    let columns = (w / widest).clamp(1, entries.len().max(1));
    let lines = entries.len().div_ceil(columns);
    let mut picture = Plane::filled(w, h + (2 + 7 * lines) * s, BLACK);
    for (out, &class) in picture.data_mut().iter_mut().zip(class.data()) {
        *out = palette.get(class).map_or(BLACK, |entry| entry.1);
    }
    for (i, (text, colour)) in entries.iter().enumerate() {
        let (left, top) = (i % columns * widest + 2 * s, h + (2 + i / columns * 7) * s);
        // The swatch is framed, because black on black would be invisible.
        fill(&mut picture, left, top, 5 * s, 5 * s, |_| GREY);
        fill(&mut picture, left + 1, top + 1, 5 * s - 2, 5 * s - 2, |_| *colour);
        write(&mut picture, left + 7 * s, top, text, s);
    }
    picture
}

/// The colours of [`validity`]: the bit that decides, and its colour. The colour-blind can tell them apart.
pub const VALIDITY: [(u32, [u8; 3]); 8] = [
    (0, [226, 226, 226]),
    (flag::OUTSIDE as u32, [0, 114, 178]),
    (flag::OCCLUDED as u32, [230, 159, 0]),
    (flag::SPECKLE as u32, [204, 121, 167]),
    (flag::TIE as u32, [86, 180, 233]),
    (flag::OUTVOTED as u32, [213, 94, 0]),
    (flag::LOW_CONFIDENCE as u32, [0, 158, 115]),
    (flag::MASKED as u32, [0, 0, 0]),
];

/// The validity map in the colours of [`VALIDITY`], with the numbers of the bits below it. If a pixel has
/// several of these flags, the first decides. A pixel that has no disparity in the end is half as bright.
#[must_use]
pub fn validity(map: &Plane<u8>) -> Plane<[u8; 3]> {
    let place = |&flags: &u8| VALIDITY.iter().position(|(bit, _)| u32::from(flags) & bit != 0).unwrap_or(0);
    let mut picture = classes(&map.map(place), &VALIDITY);
    for (out, &flags) in picture.data_mut().iter_mut().zip(map.data()) {
        if !has_disparity(flags) {
            *out = out.map(|v| v / 2);
        }
    }
    picture
}

/// A picture with one colour per pixel above a scale bar from `min` to `max`; `ramp` gives the bar's colour
/// at a position from 0 to 1.
fn with_scale(
    (w, h): (usize, usize),
    pixel: impl Fn(usize, usize) -> Rgb,
    min: f64,
    max: f64,
    ramp: impl Fn(f64) -> Rgb,
) -> Plane<Rgb> {
    let s = unit(w);
    let mut picture = Plane::filled(w, h + 16 * s, BLACK);
    for y in 0..h {
        for x in 0..w {
            picture[(x, y)] = pixel(x, y);
        }
    }
    if w == 0 {
        return picture;
    }

    let last = (w - 1).max(1) as f64;
    let top = h + s;
    fill(&mut picture, 0, top, w, 6 * s, |x| ramp(x as f64 / last));
    for (value, text) in ticks(min, max, w, s) {
        let x = ((value - min) / (max - min) * (w - 1) as f64).round() as usize;
        fill(&mut picture, x.saturating_sub(s / 2), top + 6 * s, s, 2 * s, |_| WHITE);
        let left = x.saturating_sub(text_width(&text, s) / 2).min(w.saturating_sub(text_width(&text, s)));
        write(&mut picture, left, top + 9 * s, &text, s);
    }
    picture
}

/// Size of the elements drawn below a picture of width `w`. It grows with the picture; otherwise they would
/// vanish when it is scaled down.
fn unit(w: usize) -> usize {
    (w / 200).clamp(1, 16)
}

/// The colour at position `t` from 0 to 1 between `stops` in equal steps. A `t` outside takes the nearer end,
/// and NaN (an empty range) the middle.
fn between(stops: &[Rgb], t: f64) -> Rgb {
    let t = if t.is_nan() { 0.5 } else { t.clamp(0.0, 1.0) } * (stops.len() - 1) as f64;
    let i = (t as usize).min(stops.len() - 2);
    let part = t - i as f64;
    [0, 1, 2].map(|c| (stops[i][c] as f64 * (1.0 - part) + stops[i + 1][c] as f64 * part).round() as u8)
}

/// The values to mark on the scale, with their labels: as many round numbers as fit without touching.
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
            // Adding 0 turns -0 into 0.
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

/// The smallest of 1, 2 and 5 times a power of ten that is not below `min`, and the number of decimals that
/// it needs.
fn round_step(min: f64) -> (f64, usize) {
    let (mut power, mut decimals) = (1.0, 0);
    while power * 10.0 <= min {
        power *= 10.0;
    }
    while power > min && decimals < 40 {
        decimals += 1;
        power = 10.0_f64.powi(-(decimals as i32));
    }
    let step = [1.0, 2.0, 5.0].into_iter().map(|m| m * power).find(|v| *v >= min);
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

    const MAPS: [ColourMap; 3] = [ColourMap::Turbo, ColourMap::Viridis, ColourMap::Grey];

    #[test]
    fn near_is_warm_far_is_cold_and_invalid_black() {
        let map = Plane::new(4, 1, vec![0.0, 64.0, f32::INFINITY, f32::NAN]);
        let picture = preview(&map, 0.0, 64.0, ColourMap::default());
        let [far, near, infinite, nan] = [0, 1, 2, 3].map(|x| picture[(x, 0)]);
        assert!(far[2] > far[0] && near[0] > near[2]);
        assert_eq!((infinite, nan), (BLACK, BLACK));
    }

    #[test]
    fn values_beyond_the_range_take_the_colour_of_its_end() {
        let map = Plane::new(4, 1, vec![-1e30, 2.0, 5.0, 1e30]);
        for colours in MAPS {
            let picture = preview(&map, 2.0, 5.0, colours);
            assert_eq!(picture[(0, 0)], picture[(1, 0)]);
            assert_eq!(picture[(3, 0)], picture[(2, 0)]);
            assert_ne!(picture[(1, 0)], picture[(2, 0)]);
        }
    }

    #[test]
    fn no_valid_colour_is_near_black_and_neighbours_differ_little() {
        for (colours, i) in MAPS.into_iter().flat_map(|colours| (0..=1000).map(move |i| (colours, i))) {
            let at = |i| between(colours.stops(), i as f64 / 1000.0);
            let (c, next) = (at(i), at(i + 1));
            assert!(c.iter().map(|v| *v as u32).sum::<u32>() > 150, "{colours:?}, {i}: {c:?}");
            assert!(c.iter().zip(next).all(|(a, b)| a.abs_diff(b) <= 2), "{colours:?}, {i}");
        }
    }

    #[test]
    fn lightness_rises_in_viridis_and_grey() {
        for colours in [ColourMap::Viridis, ColourMap::Grey] {
            let light = |i| {
                let [r, g, b] = between(colours.stops(), i as f64 / 100.0).map(f64::from);
                0.2126 * r + 0.7152 * g + 0.0722 * b
            };
            assert!((0..100).all(|i| light(i) <= light(i + 1) + 0.5) && light(100) > 3.0 * light(0));
        }
    }

    #[test]
    fn pictures_are_joined_side_by_side() {
        let (left, right) = (Plane::filled(2, 1, WHITE), Plane::filled(1, 3, GREY));
        let both = side_by_side(&left, &right);
        assert_eq!(both.size(), (3, 3));
        assert_eq!(both.row(0), [WHITE, WHITE, GREY]);
        assert_eq!(both.row(2), [BLACK, BLACK, GREY]);
    }

    #[test]
    fn extreme_sizes_and_ranges_do_not_panic() {
        let values =
            [0.0, -0.0, 1.0, 1e-30, f32::MIN, f32::MAX, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 64.0];
        for (w, h) in [(0, 0), (0, 3), (3, 0), (1, 1), (1, 9), (2, 1), (59, 2), (60, 1), (401, 3), (4000, 1)]
        {
            for min in values {
                for max in values {
                    let picture = preview(&Plane::filled(w, h, 7.0), min, max, ColourMap::default());
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
        assert_eq!(drawn, [".....#.", "....##.", "###..#.", ".....#.", "....###"]);
    }

    #[test]
    fn errors_are_coloured_by_sign_and_size() {
        let (inf, nan) = (f32::INFINITY, f32::NAN);
        let truth = Plane::new(7, 1, vec![10.0, 10.0, 10.0, 10.0, inf, inf, 10.0]);
        let estimate = Plane::new(7, 1, vec![6.0, 10.0, 14.0, inf, 10.0, nan, 99.0]);
        let picture = error(&estimate, &truth, 4.0);
        let at = |x| picture[(x, 0)];
        assert_eq!((at(0), at(1), at(2)), (SIGNED[0], SIGNED[3], SIGNED[6]));
        assert_eq!((at(3), at(4), at(5), at(6)), (BLACK, GREY, GREY, SIGNED[6]));
        let brightness = |c: Rgb| c.iter().map(|v| *v as i32).sum::<i32>();
        for i in 0..3 {
            assert!((brightness(SIGNED[i]) - brightness(SIGNED[6 - i])).abs() < 45, "{i}");
        }
    }

    #[test]
    fn validity_shows_the_first_reason_and_dims_missing_disparities() {
        let flags = [0, 1 | 16, 2 | 16, 2, 4 | 2 | 16, 8, 32, 4 | 16, 64, 128 | 16];
        let picture = validity(&Plane::new(10, 1, flags.to_vec()));
        let colours = VALIDITY.map(|entry| entry.1);
        let [trusted, outside, occluded, small, tie, outvoted, low, masked] = colours;
        let half = |colour: Rgb| colour.map(|v| v / 2);
        let expected =
            [trusted, outside, occluded, half(occluded), occluded, low, masked, small, half(tie), outvoted];
        assert_eq!(picture.data()[..10], expected);
        for (i, a) in colours.iter().enumerate() {
            for b in &colours[..i] {
                assert!(a.iter().zip(b).map(|(a, b)| a.abs_diff(*b) as u32).sum::<u32>() > 60, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn legends_fit_every_width() {
        for w in [0, 1, 20, 60, 240, 450, 3000] {
            for picture in [
                validity(&Plane::filled(w, 3, 0)),
                grey(&Plane::filled(w, 3, 77)),
                error(&Plane::filled(w, 3, 1.0), &Plane::filled(w, 3, 1.0), 4.0),
                classes(&Plane::filled(w, 3, 9), &[]),
            ] {
                assert_eq!(picture.width(), w);
                assert!(picture.height() > 3);
            }
        }
        // Every swatch is drawn.
        let picture = validity(&Plane::filled(240, 1, 0));
        for (bit, colour) in VALIDITY {
            assert!(picture.data()[240..].contains(&colour), "{bit}");
        }
    }
}
