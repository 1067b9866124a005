//! Warnings about a pair or a match that is probably wrong, on rendered scenes and, where `MRFGS_MIDDLEBURY`
//! names their folder, on real pairs. Sound pairs get none, and each injected defect is detected.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use mrfgs::check::{self, Part, Warning};
use mrfgs::error::{Error, RangeError};
use mrfgs::image::{Image, Pair, Plane, Rect, calib::Calibration, grey, read};
use mrfgs::low_level::engine::Inspection;
use mrfgs::maps::{FRACTION, Maps};
use mrfgs::options::{DisparityRange, Method};
use mrfgs::{AutoRange, Matched, Matcher};
use std::io::Write;
use std::path::{Path, PathBuf};

struct Case {
    name: String,
    pair: Pair,
    range: DisparityRange,
    /// Known true disparities, the smallest first.
    truths: Vec<f32>,
}

impl Case {
    fn load(folder: &Path) -> Self {
        let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
        let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
        let truth = read::read_disparity(&folder.join("disp0GT.pfm")).unwrap();
        let mut truths: Vec<f32> = truth.data().iter().copied().filter(|d| d.is_finite()).collect();
        truths.sort_by(f32::total_cmp);
        Self {
            name: folder.display().to_string(),
            pair: Pair::open(&left, &right).unwrap(),
            range: DisparityRange::new(0, ndisp as i32 - 1).unwrap(),
            truths,
        }
    }

    fn scene(name: &str) -> Self {
        Self::load(&Path::new("testdata").join(name))
    }

    /// The true disparity below which `percent` of the pixels lie.
    fn truth(&self, percent: usize) -> f32 {
        self.truths[(self.truths.len() - 1) * percent / 100]
    }

    fn maps(&self, range: DisparityRange) -> Maps {
        let mut matcher = Matcher::builder().device("cpu").build().unwrap();
        matcher.run(&self.pair, range).unwrap().maps
    }

    /// The warnings about [`Case::exposure`].
    fn exposed(&self, change: impl Fn(f64) -> f64) -> Vec<Warning> {
        check::warnings(&self.exposure(change), Some(self.range))
    }

    /// The pair with `change` applied to each 8-bit level of the right view.
    fn exposure(&self, change: impl Fn(f64) -> f64) -> Pair {
        let right = self.pair.right();
        let level = |v: u16| (change(f64::from(v >> 8)).round().clamp(0.0, 255.0) as u16) << 8;
        let pixels = right.pixels.map(|&[r, g, b, _]| {
            let [r, g, b] = [r, g, b].map(level);
            [r, g, b, grey(r, g, b)]
        });
        let right = Image { pixels, masked: right.masked.clone() };
        Pair::new(self.pair.left().clone(), right).unwrap()
    }
}

/// The scenes whose views are shifted, rotated and exchanged.
const SCENES: [&str; 6] = ["slanted", "thin", "wall", "repetitive", "exposure", "mixed"];

/// All scenes, and all available real pairs.
fn cases() -> Vec<Case> {
    cases_of(&["slanted", "thin", "wall", "repetitive", "exposure", "light", "steep", "mixed"])
}

/// These scenes, and all available real pairs.
fn cases_of(scenes: &[&str]) -> Vec<Case> {
    let mut folders: Vec<PathBuf> = scenes.iter().map(|scene| Path::new("testdata").join(scene)).collect();
    if let Some(folder) = std::env::var_os("MRFGS_MIDDLEBURY") {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        folders.extend(entries.filter(|path| path.join("im0.png").is_file()));
    } else {
        let _ = writeln!(std::io::stderr(), "SKIPPED on real pairs: MRFGS_MIDDLEBURY names no folder");
    }
    folders.iter().map(|folder| Case::load(folder)).collect()
}

/// `image` with the pixel at (x, y) taken from `from(x, y)`, clamped to the image.
fn moved(image: &Image, from: impl Fn(i32, i32) -> (i32, i32)) -> Image {
    let (width, height) = image.pixels.size();
    let at = |x: usize, y: usize| {
        let (x, y) = from(x as i32, y as i32);
        (x.clamp(0, width as i32 - 1) as usize, y.clamp(0, height as i32 - 1) as usize)
    };
    Image {
        pixels: Plane::from_fn(width, height, |x, y| image.pixels[at(x, y)]),
        masked: Plane::from_fn(width, height, |x, y| image.masked[at(x, y)]),
    }
}

#[test]
fn sound_pairs_get_no_warning() {
    for case in cases() {
        assert_eq!(check::warnings(&case.pair, Some(case.range)), [], "{}", case.name);
        assert_eq!(check::warnings_of(&case.maps(case.range), case.range, 2), [], "{}", case.name);
        // A small change of brightness is harmless.
        for (gain, offset) in [(0.72, 14.0), (0.5, 0.0), (1.0, 20.0), (1.0, -20.0)] {
            assert_eq!(case.exposed(|v| gain * v + offset), [], "{}, {gain} {offset}", case.name);
        }
    }
}

#[test]
fn different_exposures_are_warned_about() {
    for case in cases() {
        let dark = case.exposed(|v| v * 0.15);
        assert!(
            dark.iter().any(|w| matches!(w, Warning::Contrast { percent: 8..=20 })),
            "{}: {dark:?}",
            case.name
        );
        let bright = case.exposed(|v| v * 3.0);
        let told =
            |w: &Warning| matches!(w, Warning::Saturated { percent: [left, right] } if left + 10 <= *right);
        assert!(bright.iter().any(told), "{}: {bright:?}", case.name);
    }
}

#[test]
fn a_view_of_one_colour_is_warned_about() {
    let case = Case::scene("mixed");
    let (width, height) = case.pair.size();
    let noise = |x: usize, y: usize| ((x * x * 31 + y * y * 17 + x * y * 13) % 3) as u8;
    let plain = Image::from_rgb8(&Plane::from_fn(width, height, |x, y| [90 + noise(x, y), 120, 30]));
    let told =
        |left: &Image, right: &Image| check::warnings(&Pair::new(left.clone(), right.clone()).unwrap(), None);
    let is_plain = |view: &'static str| Warning::Plain { view };
    assert_eq!(told(&plain, case.pair.right()), [is_plain("left")]);
    assert_eq!(told(case.pair.left(), &plain), [is_plain("right")]);
    assert_eq!(told(&plain, &plain), [is_plain("left"), is_plain("right")]);
    // Masked pixels are ignored; a view that is masked completely has a warning of its own.
    let mut mostly = case.pair.left().clone();
    for y in 0..height {
        for x in 0..width {
            mostly.masked[(x, y)] = x > 9;
            if x <= 9 {
                mostly.pixels[(x, y)] = plain.pixels[(x, y)];
            }
        }
    }
    assert_eq!(told(&mostly, case.pair.right()), [is_plain("left")]);
    mostly.masked = Plane::filled(width, height, true);
    let left = Warning::Masked { view: "left" };
    assert_eq!(told(&mostly, case.pair.right()), [left]);
    assert_eq!(told(case.pair.left(), &mostly), [Warning::Masked { view: "right" }]);
}

/// Views that do not belong together still give a dense map, so a warning must say that it is worthless.
#[test]
fn views_that_hardly_match_are_warned_about() {
    let scene = |name: &str| Case::scene(name).pair;
    let (slanted, mixed, thin) = (scene("slanted"), scene("mixed"), scene("thin"));
    let inverted = |image: &Image| Image {
        pixels: image.pixels.map(|[r, g, b, _]| {
            let [r, g, b] = [r, g, b].map(|v| 0xff00 - (v & 0xff00));
            [r, g, b, grey(r, g, b)]
        }),
        ..image.clone()
    };
    let lower = |image: &Image| {
        let (width, height) = image.pixels.size();
        let pixels = Plane::from_fn(width, height, |x, y| image.pixels[(x, (y + height - 24) % height)]);
        Image { pixels, ..image.clone() }
    };
    let with_right = |pair: &Pair, right: Image| Pair::new(pair.left().clone(), right).unwrap();
    let wrong = [
        ("two scenes", with_right(&slanted, thin.right().clone())),
        ("inverted", with_right(&slanted, inverted(slanted.right()))),
        ("24 rows lower", with_right(&mixed, lower(mixed.right()))),
    ];
    for method in [Method::default(), Method::fast()] {
        let mut matcher = Matcher::builder().method(method).device("cpu").build().unwrap();
        let mut told = |pair: &Pair| matcher.run(pair, 0..=47).unwrap().warnings();
        for (what, pair) in &wrong {
            let warnings = told(pair);
            assert!(
                matches!(warnings[..], [Warning::HardlyMatch { percent: 0..35 }]),
                "{what}: {warnings:?}"
            );
        }
        // Controls: sound pairs, and one that is masked completely.
        assert_eq!(told(&slanted), []);
        assert_eq!(told(&mixed), []);
        let mut masked = mixed.left().clone();
        masked.masked = Plane::filled(320, 240, true);
        assert_eq!(told(&Pair::new(masked, mixed.right().clone()).unwrap()), []);
    }
}

/// An automatic range that clips the scene is widened, and a range given by a user is kept.
#[test]
fn an_automatic_range_is_widened() {
    let case = Case::scene("mixed");
    for method in [Method::default(), Method::fast()] {
        let mut matcher = Matcher::builder().method(method).device("cpu").build().unwrap();
        let cut = DisparityRange::new(0, 25).unwrap();
        let again = matcher.run(&case.pair, AutoRange(cut)).unwrap();
        assert_eq!((again.range().min, again.range().max, again.range_found), (0, 38, true));
        let wider = matcher.run(&case.pair, 0..=38).unwrap();
        assert!(again.maps == wider.maps && !wider.range_found);
        let given = matcher.run(&case.pair, cut).unwrap();
        assert!(given.range() == cut && !given.warnings().is_empty());
        // A range that holds the scene is kept.
        let enough = matcher.run(&case.pair, AutoRange(case.range)).unwrap();
        assert_eq!(enough.range(), case.range);
        // The lower end of an automatic range does not count, because distant points have sparse matches.
        let high = DisparityRange::new(22, 47).unwrap();
        let lower = |found: &Matched| {
            found.warnings().iter().any(|w| matches!(w, Warning::Clipped { upper: false, .. }))
        };
        assert!(lower(&matcher.run(&case.pair, high).unwrap()));
        assert!(!lower(&matcher.run(&case.pair, AutoRange(high)).unwrap()));
        // An inspected job runs one match, without widening.
        let mut prepared = 0;
        let job = matcher.job(&case.pair, AutoRange(cut)).inspect(|seen| {
            prepared += usize::from(matches!(seen, Inspection::Prepared(_)));
            Ok(())
        });
        assert_eq!((job.run().unwrap().range(), prepared), (cut, 1));
    }
}

#[test]
fn a_range_that_clips_the_scene_is_warned_about() {
    for case in cases() {
        // The range excludes a tenth or a third of the true disparities; some surfaces end just there.
        let told = |range: DisparityRange| check::warnings_of(&case.maps(range), range, 2);
        let ends = |warnings: &[Warning], at_top: bool| {
            warnings.iter().any(|w| matches!(w, Warning::Clipped { upper, .. } if *upper == at_top))
        };
        let least = case.truth(0).floor() as i32 - 1;
        let cut = [90, 66]
            .map(|percent| told(DisparityRange::new(least.min(0), case.truth(percent) as i32).unwrap()));
        assert!(cut.iter().any(|warnings| ends(warnings, true)), "{}: {cut:?}", case.name);
        let cut = [10, 33].map(|percent| {
            told(DisparityRange::new(case.truth(percent).ceil() as i32, case.range.max).unwrap())
        });
        assert!(cut.iter().any(|warnings| ends(warnings, false)), "{}: {cut:?}", case.name);
    }
    // Matching at half size clamps disparities to the range.
    let case = Case::scene("mixed");
    let mut matcher = Matcher::builder().method(Method::fast()).device("cpu").build().unwrap();
    let mut told = |max: i32| {
        let range = DisparityRange::new(0, max).unwrap();
        let maps = matcher.run(&case.pair, range).unwrap().maps;
        for map in [&maps.raw, &maps.disparity] {
            assert!(map.data().iter().all(|d| (0..=max * FRACTION).contains(d)), "0 to {max}");
        }
        check::warnings_of(&maps, range, 1)
    };
    assert!(matches!(told(20)[..], [Warning::Clipped { end: 20, upper: true, percent: 20..35 }]));
    assert_eq!(told(case.range.max), []);
    // A lower end of 0 is the horizon and clips nothing; ranges of a single label get no warning.
    let case = Case::scene("mixed");
    let mut maps = case.maps(case.range);
    maps.raw = Plane::filled(case.pair.size().0, case.pair.size().1, 0);
    assert_eq!(check::warnings_of(&maps, case.range, 2), []);
    assert_eq!(check::warnings_of(&maps, DisparityRange::new(0, 0).unwrap(), 2), []);
    let told = check::warnings_of(&maps, DisparityRange::new(-9, 0).unwrap(), 2);
    assert_eq!(told, [Warning::Clipped { end: 0, upper: true, percent: 100 }]);
}

/// Guesses make noise agree, but with little confidence.
#[test]
fn views_of_noise_hardly_match_with_one_look_or_two() {
    let mut seed = 7u64;
    let mut noise = || {
        // SplitMix64, since channels and pixels must not depend on each other.
        let pixels = Plane::from_fn(300, 200, |_, _| {
            seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (seed ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            [0, 16, 32].map(|shift| (mixed >> shift) as u8)
        });
        Image::from_rgb8(&pixels)
    };
    let pair = Pair::new(noise(), noise()).unwrap();
    let range = DisparityRange::new(0, 15).unwrap();
    for looks in [1, 2] {
        let mut method = Method::default();
        method.schedule.looks = looks;
        let mut matcher = Matcher::builder().method(method).device("cpu").build().unwrap();
        let matched = matcher.run(&pair, range).unwrap();
        let warnings = matched.warnings();
        assert!(matches!(warnings[..], [Warning::HardlyMatch { .. }]), "{looks}: {warnings:?}");
        // Control: after two looks, the pixels that agree are too many.
        let all = check::warnings_of(&matched.maps, range, 1);
        assert_eq!(matches!(all[..], [Warning::HardlyMatch { .. }]), looks == 1, "{looks}: {all:?}");
    }
}

#[test]
fn unrectified_pairs_are_warned_about() {
    for case in cases_of(&SCENES) {
        assert_eq!(check::warnings(&case.pair, None), [], "{}", case.name);
        for rows in [1, -1, 2, -5] {
            let right = moved(case.pair.right(), |x, y| (x, y - rows));
            let pair = Pair::new(case.pair.left().clone(), right).unwrap();
            let warnings = check::warnings(&pair, Some(case.range));
            let [Warning::NotRectified { offset }] = warnings[..] else {
                panic!("{}, {rows} rows: {warnings:?}", case.name)
            };
            assert!(offset.abs_diff(rows.unsigned_abs() * 256) < 100, "{}, {rows} rows: {offset}", case.name);
        }
        // A slight rotation: without a common offset, the rows still do not match.
        let width = case.pair.size().0 as i32;
        let right = moved(case.pair.right(), |x, y| (x, y - (x - width / 2) * 12 / width));
        let pair = Pair::new(case.pair.left().clone(), right).unwrap();
        let warnings = check::warnings(&pair, None);
        assert!(matches!(warnings[..], [Warning::NotRectified { .. }]), "{}: {warnings:?}", case.name);
    }
}

#[test]
fn turned_views_are_warned_about() {
    for case in cases_of(&SCENES) {
        let (left, right) = (case.pair.left(), case.pair.right());
        for (how, turned) in [
            ("upside down", right.flipped()),
            ("mirrored", right.mirrored()),
            ("turned by half a turn", right.flipped().mirrored()),
        ] {
            let pair = Pair::new(left.clone(), turned).unwrap();
            for range in [None, Some(case.range)] {
                assert_eq!(check::warnings(&pair, range), [Warning::Turned { how }], "{}", case.name);
            }
        }
        // Turning the left view alone is detected, and turning both gives an ordinary pair.
        let pair = Pair::new(left.flipped(), right.clone()).unwrap();
        assert_eq!(check::warnings(&pair, None), [Warning::Turned { how: "upside down" }], "{}", case.name);
        let pair = Pair::new(left.flipped(), right.flipped()).unwrap();
        assert_eq!(check::warnings(&pair, Some(case.range)), [], "{}", case.name);
        // In pairs turned by a quarter, rows are columns.
        for turned in [Image::flipped, Image::mirrored] {
            let pair = Pair::new(turned(&left.transposed()), turned(&right.transposed())).unwrap();
            assert_eq!(check::warnings(&pair, None), [Warning::Sideways], "{}", case.name);
        }
        let side = left.width().min(left.height());
        let square = |image: &Image| image.crop(&Rect { x: 0..side, y: 0..side });
        for turned in [Image::flipped, Image::mirrored] {
            let pair = Pair::new(square(left), turned(&square(right).transposed())).unwrap();
            let how = "turned by a quarter";
            assert_eq!(check::warnings(&pair, None), [Warning::Turned { how }], "{}", case.name);
        }
    }
}

/// If a known mistake explains why no range was found, the error names it.
#[test]
fn a_missing_range_is_explained() {
    let mut refused = [0; 2];
    for case in SCENES.map(Case::scene) {
        let (left, right) = (case.pair.left(), case.pair.right());
        let mirrored = Pair::new(left.clone(), right.mirrored());
        let sideways = Pair::new(left.transposed(), right.transposed());
        for (i, (pair, words)) in
            [(mirrored, "is mirrored"), (sideways, "on the same column")].into_iter().enumerate()
        {
            // Some scenes have enough false matches for a range.
            if let Err(error) = check::range(&pair.unwrap()) {
                assert!(error.to_string().contains(words), "{}: {error}", case.name);
                refused[i] += 1;
            }
        }
    }
    assert!(refused.iter().all(|count| *count >= 3), "{refused:?}");
    // Low contrast is not named as the cause, because a given range may still match such views.
    let (case, other) = (Case::scene("slanted"), Case::scene("thin"));
    let strangers =
        Case { pair: Pair::new(case.pair.left().clone(), other.pair.right().clone()).unwrap(), ..case };
    let pair = strangers.exposure(|v| v * 0.15);
    assert!(matches!(check::warnings(&pair, None)[..], [Warning::Contrast { .. }]));
    let found = check::range(&pair);
    assert!(matches!(found, Err(Error::Range(RangeError::NotFound { cause: None }))), "{found:?}");
}

#[test]
fn swapped_views_are_warned_about() {
    for case in SCENES.map(Case::scene) {
        let swapped = Pair::new(case.pair.right().clone(), case.pair.left().clone()).unwrap();
        for range in [None, Some(case.range)] {
            let warnings = check::warnings(&swapped, range);
            assert!(matches!(warnings[..], [Warning::Swapped { .. }]), "{}: {warnings:?}", case.name);
        }
        // A range of negative disparities expects this order, so there is no warning.
        let negative = DisparityRange::new(-31, 0).unwrap();
        assert_eq!(check::warnings(&swapped, Some(negative)), [], "{}", case.name);
    }
}

/// The order of the views can be told only once the rows match.
#[test]
fn unrectified_views_may_be_in_order() {
    let mixed = Case::scene("mixed").pair;
    let aside = |image: &Image, (right, down): (i32, i32)| moved(image, |x, y| (x - right, y - down));
    let told = |left: &Image, right: Image| check::warnings(&Pair::new(left.clone(), right).unwrap(), None);
    // The right camera looks to the left, so everything lies further right in its view.
    let warnings = told(mixed.left(), aside(mixed.right(), (60, 3)));
    assert!(matches!(warnings[..], [Warning::NotRectified { .. }]), "{warnings:?}");
    let warnings = told(mixed.right(), aside(mixed.left(), (0, 3)));
    assert!(matches!(warnings[..], [Warning::NotRectified { .. }]), "{warnings:?}");
    // Control: the rows match, and the order is wrong.
    let warnings = told(mixed.right(), mixed.left().clone());
    assert!(matches!(warnings[..], [Warning::Swapped { .. }]), "{warnings:?}");
}

/// `image`, with the pixels where `is_there` holds taken from `other`.
fn mixed_with(image: &Image, other: &Image, is_there: impl Fn(usize, usize) -> bool) -> Image {
    let (width, height) = image.pixels.size();
    let from = |x, y| if is_there(x, y) { other } else { image };
    Image {
        pixels: Plane::from_fn(width, height, |x, y| from(x, y).pixels[(x, y)]),
        masked: image.masked.clone(),
    }
}

/// Three box filters in a row: nearly a Gaussian.
fn blurred(image: &Image, radius: i32) -> Image {
    let mut planes: [Plane<f64>; 3] = std::array::from_fn(|i| image.pixels.map(|p| f64::from(p[i] >> 8)));
    let (width, height) = image.pixels.size();
    for plane in &mut planes {
        for _ in 0..3 {
            for (dx, dy) in [(1, 0), (0, 1)] {
                *plane = Plane::from_fn(width, height, |x, y| {
                    let at = |step: i32| {
                        let x = (x as i32 + step * dx).clamp(0, width as i32 - 1);
                        let y = (y as i32 + step * dy).clamp(0, height as i32 - 1);
                        plane[(x as usize, y as usize)]
                    };
                    (-radius..=radius).map(at).sum::<f64>() / f64::from(2 * radius + 1)
                });
            }
        }
    }
    Image::from_rgb8(&Plane::from_fn(width, height, |x, y| {
        std::array::from_fn(|i| planes[i][(x, y)].round() as u8)
    }))
}

/// Selects the pixels of a part of an image.
type Pixels<'a> = &'a dyn Fn(usize, usize) -> bool;

/// A view with a defective part still gives a good map of the rest. Faint texture alone is no defect.
#[test]
fn defective_parts_are_warned_about() {
    const SOUND: [&str; 15] = [
        "slanted",
        "thin",
        "wall",
        "repetitive",
        "exposure",
        "light",
        "steep",
        "mixed",
        "focus",
        "grain",
        "poster",
        "screen",
        "border",
        "corridor",
        "behind",
    ];
    for scene in SOUND {
        assert_eq!(check::warnings(&Case::scene(scene).pair, None), [], "control: {scene}");
    }
    let (mixed, other) = (Case::scene("mixed").pair, Case::scene("exposure").pair);
    for scene in ["mixed", "slanted"] {
        let pair = Case::scene(scene).pair;
        let (left, right) = (pair.left(), pair.right());
        let (width, height) = pair.size();
        let of = if scene == "mixed" { other.right() } else { mixed.right() };
        let (w, h) = of.pixels.size();
        // Another scene, tiled to this size, and the same scene shifted down.
        let strange = Plane::from_fn(width, height, |x, y| of.pixels[(x % w, y % h)]);
        let strange = Image { pixels: strange, ..right.clone() };
        let [much, little] = [20, 3].map(|rows| moved(right, |x, y| (x, y - rows)));
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729) * (x + 3 * y + 11) / 7 % 251) as u8;
        let noise = Image::from_rgb8(&Plane::from_fn(width, height, |x, y| [noise(x, y); 3]));
        let plain = Image::from_rgb8(&Plane::filled(width, height, [90; 3]));
        let blur = blurred(right, 4);
        let half = |y: usize| y >= height / 2;
        let told = |left: &Image, right: Image| {
            let warnings = check::warnings(&Pair::new(left.clone(), right).unwrap(), None);
            <[Warning; 1]>::try_from(warnings).unwrap_or_else(|more| panic!("{scene}: {more:?}"))[0].clone()
        };
        let rows = |first: usize, last: usize| Part::Rows { first, last, of: height };
        let columns = |first: usize, last: usize| Part::Columns { first, last, of: width };

        // A part copied from the other view.
        let copies: [(Part, Pixels); 4] = [
            (rows(0, height / 2 - 1), &|_, y| !half(y)),
            (rows(height / 2, height - 1), &|_, y| half(y)),
            (columns(0, width / 2 - 1), &|x, _| x < width / 2),
            (columns(width / 2, width - 1), &|x, _| x >= width / 2),
        ];
        for (part, is_there) in copies {
            assert_eq!(told(left, mixed_with(right, left, is_there)), Warning::Copied { part }, "{scene}");
        }
        // Blur of the whole view or a part, and a part of one colour.
        let lacks = |view, part| Warning::Blurred { view, part };
        // The uppermost rows of one scene are plain, so blur does not change them.
        let all = [Part::Whole, rows(height / 8, height - 1)];
        let is_all = |warning, view| all.iter().any(|part| warning == lacks(view, *part));
        assert!(is_all(told(left, blur.clone()), "right"), "{scene}");
        assert!(is_all(told(&blurred(left, 4), right.clone()), "left"), "{scene}");
        let lower_half = rows(height / 2, height - 1);
        for with in [&blur, &plain] {
            assert_eq!(
                told(left, mixed_with(right, with, |_, y| half(y))),
                lacks("right", lower_half),
                "{scene}"
            );
        }
        // A part of another scene, or moved down. (With half of it 3 rows off, the pair is not rectified.)
        for (what, with, top) in [
            ("scene", &strange, height / 2),
            ("20 rows", &much, height / 2),
            ("3 rows", &little, 2 * height / 3),
        ] {
            let torn = told(left, mixed_with(right, with, |_, y| y >= top));
            let Warning::Torn { part: Part::Rows { first, last, .. } } = torn else {
                panic!("{scene}, {what}: {torn:?}")
            };
            assert!(first.abs_diff(top) < 20 && last + 20 > height, "{scene}, {what}: {torn:?}");
        }
        // Where one view is noise, the other lacks its detail.
        let noisy = |image: &Image| mixed_with(image, &noise, |_, y| half(y));
        assert_eq!(told(left, noisy(right)), lacks("left", lower_half), "{scene}");
        assert_eq!(told(&noisy(left), right.clone()), lacks("right", lower_half), "{scene}");
        // Masking a part of the right view alone causes no warning.
        let mut masked = right.clone();
        masked.masked = Plane::from_fn(width, height, |_, y| half(y));
        assert_eq!(check::warnings(&Pair::new(left.clone(), masked).unwrap(), None), [], "{scene}");
    }
}

/// Pixels masked in one view are excluded from the statistics of both.
#[test]
fn a_mask_causes_no_warning() {
    let mixed = Case::scene("mixed").pair;
    let (width, height) = mixed.size();
    let masked = |is_masked: &dyn Fn(usize, usize) -> bool| {
        let mut left = mixed.left().clone();
        left.masked = Plane::from_fn(width, height, is_masked);
        Pair::new(left, mixed.right().clone()).unwrap()
    };
    // The upper rows have little contrast and the others much, so ignoring the mask would compare different rows.
    let plain_rows = masked(&|_, y| y >= 20);
    assert_eq!(check::warnings(&plain_rows, None), []);
    let exposed = |gain: u16| {
        let mut pair = plain_rows.clone();
        let pixels = pair.right().pixels.map(|p| p.map(|v| v / gain));
        pair = Pair::new(pair.left().clone(), Image { pixels, ..pair.right().clone() }).unwrap();
        check::warnings(&pair, None)
    };
    assert!(exposed(8).iter().any(|w| matches!(w, Warning::Contrast { .. })), "control: {:?}", exposed(8));

    // Most of what a mask of 85 % leaves is unmatched: at the left border, outside the right view, and on small islands.
    let mut matcher = Matcher::builder().method(Method::fast()).device("cpu").build().unwrap();
    let mut told = |pair: &Pair| matcher.run(pair, 0..=47).unwrap().warnings();
    for is_masked in [(|x, _| x >= 40) as fn(usize, usize) -> bool, |x, y| x % 25 >= 10 || y % 26 >= 10] {
        let warnings = told(&masked(&is_masked));
        assert!(
            matches!(warnings[..], [Warning::LittleLeft { percent: 0..35, masked: 80..90 }]),
            "{warnings:?}"
        );
    }
    assert_eq!(told(&masked(&|x, y| (100..224).contains(&x) || (75..168).contains(&y))), []);
}

#[test]
fn identical_images_are_warned_about() {
    let case = Case::scene("mixed");
    let left = case.pair.left();
    let mut other = left.clone();
    other.pixels[(9, 9)] = [1, 2, 3, 4];
    assert_eq!(check::warnings(&Pair::new(left.clone(), left.clone()).unwrap(), None), [Warning::Identical]);
    // A difference in one pixel still counts as a copy.
    let copied = [Warning::Copied { part: Part::Whole }];
    assert_eq!(check::warnings(&Pair::new(left.clone(), other.clone()).unwrap(), None), copied);
    // A difference at a masked pixel is ignored.
    other.masked[(9, 9)] = true;
    assert_eq!(check::warnings(&Pair::new(left.clone(), other).unwrap(), None), [Warning::Identical]);
}

#[test]
fn warnings_are_one_line_with_the_cause() {
    for (warning, words) in [
        (Warning::Identical, ["the same", "right view"]),
        (Warning::NotRectified { offset: 512 }, ["2.0 px", "not rectified"]),
        (Warning::Turned { how: "upside down" }, ["upside down", "turn it back"]),
        (Warning::Sideways, ["same column", "turn both"]),
        (
            Warning::Copied { part: Part::Columns { first: 0, last: 9, of: 20 } },
            ["in columns 0 to 9 of 20", "wrote"],
        ),
        (
            Warning::Blurred { view: "left", part: Part::Whole },
            ["the left view has far less detail", "everywhere"],
        ),
        (Warning::Torn { part: Part::Rows { first: 4, last: 9, of: 10 } }, ["in rows 4 to 9 of 10", "torn"]),
        (Warning::LittleLeft { percent: 4, masked: 85 }, ["only 4 %", "covers 85 %"]),
        (Warning::Swapped { percent: 97 }, ["97 %", "seem to be swapped"]),
        (Warning::Plain { view: "left" }, ["the left view is all one colour", "right image"]),
        (Warning::Contrast { percent: 12 }, ["12 % of the other's contrast", "expose both alike"]),
        (
            Warning::Saturated { percent: [1, 37] },
            ["1 % of the left view and 37 % of the right", "nothing can be matched"],
        ),
        (Warning::Clipped { end: 63, upper: true, percent: 9 }, ["9 %", "at disparity 63"]),
        (Warning::Clipped { end: 63, upper: true, percent: 9 }, ["cuts off", "an end of the range"]),
        (Warning::Clipped { end: -5, upper: false, percent: 9 }, ["-5", "cuts off"]),
        (Warning::Contradicted { percent: 0 }, ["contradict the prior, so it was not used", "this scene"]),
        (Warning::Contradicted { percent: 62 }, ["contradict the prior in part", "counts 62 %"]),
    ] {
        let line = warning.to_string();
        assert!(!line.contains('\n') && words.iter().all(|w| line.contains(w)), "{line}");
    }
}
