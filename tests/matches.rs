//! Sparse matches and their use: always on rendered scenes, and on real pairs where `MRFGS_MIDDLEBURY` names
//! their folder.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

use mrfgs::check::{self, Warning};
use mrfgs::error::{Error, RangeError};
use mrfgs::image::{Image, Pair, Plane, Rect, calib::Calibration, pfm, read};
use mrfgs::low_level::front::label_range::{self, LabelRanges, MIN_MATCHES};
use mrfgs::low_level::front::matches::{self, SparseMatch};
use mrfgs::maps::FRACTION;
use mrfgs::options::DisparityRange;
use std::io::Write;
use std::path::{Path, PathBuf};

const SCENES: [&str; 6] = ["slanted", "thin", "wall", "repetitive", "exposure", "mixed"];

struct Case {
    name: String,
    pair: Pair,
    range: DisparityRange,
    truth: Plane<f32>,
    visible: Plane<u8>,
}

impl Case {
    fn load(folder: &Path) -> Self {
        let (left, right) = (folder.join("im0.png"), folder.join("im1.png"));
        let ndisp = Calibration::beside(&left).unwrap().unwrap().ndisp.unwrap();
        let pfm::Pfm::Grey(truth) = pfm::read(&folder.join("disp0GT.pfm")).unwrap() else {
            panic!("colour truth")
        };
        Self {
            name: folder.display().to_string(),
            pair: Pair::open(&left, &right).unwrap(),
            range: DisparityRange::new(0, ndisp as i32 - 1).unwrap(),
            truth,
            visible: read::grey8(&folder.join("mask0nocc.png")).unwrap(),
        }
    }

    fn scene(name: &str) -> Self {
        Self::load(&Path::new("testdata").join(name))
    }

    /// The number of pixels per match, and the percentage of matches more than 1.5 px off among the
    /// pixels that both views see.
    fn accuracy(&self, found: &[SparseMatch]) -> (usize, f64) {
        let errors: Vec<f32> = found
            .iter()
            .filter(|m| self.visible[(m.x, m.y)] == 255)
            .map(|m| (m.disparity as f32 / FRACTION as f32 - self.truth[(m.x, m.y)]).abs())
            .collect();
        let bad = errors.iter().filter(|e| **e > 1.5).count();
        (self.truth.data().len() / found.len().max(1), 100.0 * bad as f64 / errors.len() as f64)
    }

    /// The true disparities that are known.
    fn truths(&self) -> impl Iterator<Item = f32> {
        self.truth.data().iter().copied().filter(|t| t.is_finite())
    }
}

/// The five real pairs, if available.
fn real_pairs() -> Vec<Case> {
    let Some(folder) = std::env::var_os("MRFGS_MIDDLEBURY").map(PathBuf::from) else {
        let _ = writeln!(std::io::stderr(), "SKIPPED on real pairs: MRFGS_MIDDLEBURY names no folder");
        return Vec::new();
    };
    ["Teddy", "Cones", "Dolls", "Rocks1", "Motorcycle"].map(|pair| Case::load(&folder.join(pair))).into()
}

/// Zones of five brightness bands in three columns of the image.
fn crude_zones(image: &Image) -> Plane<u32> {
    let mut greys: Vec<u16> = image.pixels.data().iter().map(|p| p[3]).collect();
    greys.sort_unstable();
    let limits: Vec<u16> = (1..5).map(|i| greys[greys.len() * i / 5]).collect();
    let (width, height) = image.pixels.size();
    Plane::from_fn(width, height, |x, y| {
        let band = limits.iter().filter(|limit| image.pixels[(x, y)][3] >= **limit).count();
        (3 * band + 3 * x / width) as u32
    })
}

#[test]
fn matches_of_rendered_scenes_are_right() {
    // The limits: pixels per match, and the percentage of matches more than 1.5 px off.
    let floors = [
        ("slanted", 90, 1.5),
        ("thin", 120, 4.0),
        ("wall", 230, 2.5),
        ("repetitive", 200, 5.0),
        ("exposure", 90, 1.5),
        ("mixed", 110, 2.5),
    ];
    for (scene, spacing, wrong) in floors {
        let case = Case::scene(scene);
        for range in [Some(case.range), None] {
            let (pixels, bad) = case.accuracy(&matches::find(&case.pair, None, range));
            println!("{scene} {range:?}: one in {pixels} px, {bad:.2} % off");
            assert!(pixels <= spacing && bad <= wrong, "{scene}: one in {pixels} px, {bad:.2} % off");
        }
    }
}

#[test]
fn matches_of_real_pairs_are_right() {
    for case in real_pairs() {
        for range in [Some(case.range), None] {
            let (pixels, bad) = case.accuracy(&matches::find(&case.pair, None, range));
            println!("{} {range:?}: one in {pixels} px, {bad:.2} % off", case.name);
            assert!(pixels <= 150 && bad <= 4.0, "{}: one in {pixels} px, {bad:.2} % off", case.name);
        }
    }
}

#[test]
fn disparities_lie_between_the_pixels() {
    let case = Case::scene("slanted");
    let found = matches::find(&case.pair, None, Some(case.range));
    let mean = |disparity: fn(&SparseMatch) -> i32| {
        let errors = found.iter().map(|m| {
            let error = disparity(m) as f32 / FRACTION as f32 - case.truth[(m.x, m.y)];
            error.abs().min(1.5)
        });
        errors.sum::<f32>() / found.len() as f32
    };
    let whole = mean(|m| (m.disparity + FRACTION / 2).div_euclid(FRACTION) * FRACTION);
    let (exact, mirrored) = (
        mean(|m| m.disparity),
        // Control: a fraction of the wrong sign.
        mean(|m| 2 * ((m.disparity + FRACTION / 2).div_euclid(FRACTION) * FRACTION) - m.disparity),
    );
    assert!(
        exact < 0.6 * whole && exact < 0.4 * mirrored,
        "{exact}, in whole pixels {whole}, mirrored {mirrored}"
    );
}

#[test]
fn the_score_is_the_correlation_of_the_windows() {
    let case = Case::scene("exposure");
    let window = |image: &Image, x: usize, y: usize| -> Vec<f64> {
        let at = |i: usize| f64::from(image.pixels[(x + i % 7 - 3, y + i / 7 - 3)][3] >> 4);
        let mean = (0..49).map(at).sum::<f64>() / 49.0;
        (0..49).map(|i| at(i) - mean).collect()
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let found = matches::find(&case.pair, None, Some(case.range));
    assert!(found.len() > 100);
    for m in found {
        // The window is at whole pixels, so at most half a pixel from the match.
        let d = (m.disparity + FRACTION / 2).div_euclid(FRACTION);
        let left = window(case.pair.left(), m.x, m.y);
        let right = window(case.pair.right(), (m.x as i32 - d) as usize, m.y);
        let score = dot(&left, &right) / (dot(&left, &left) * dot(&right, &right)).sqrt();
        assert!((score - m.score).abs() < 1e-9, "{m:?}: {score}");
    }
}

#[test]
fn threads_change_nothing() {
    let case = Case::scene("mixed");
    let zones = crude_zones(case.pair.left());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            (
                matches::find(&case.pair, Some((&zones, 15)), Some(case.range)),
                check::range(&case.pair).unwrap(),
                check::warnings(&case.pair, None),
            )
        })
    };
    let one = on(1);
    assert!(one.0.len() > 300);
    assert!(one.0.is_sorted_by_key(|m| (m.y, m.x)));
    assert_eq!(one, on(2));
}

#[test]
fn only_the_range_is_searched() {
    let case = Case::scene("slanted");
    let range = DisparityRange::new(12, 15).unwrap();
    let found = matches::find(&case.pair, None, Some(range));
    assert!(!found.is_empty());
    for m in found {
        assert!((12 * FRACTION - 128..=15 * FRACTION + 128).contains(&m.disparity), "{m:?}");
    }
    // With the views exchanged, all disparities are negative.
    let swapped = Pair::new(case.pair.right().clone(), case.pair.left().clone()).unwrap();
    let all = matches::find(&swapped, None, None);
    let negative = DisparityRange::new(-31, 0).unwrap();
    assert!(all.len() > 300 && matches::find(&swapped, None, Some(negative)).len() > 300);
    assert!(all.iter().filter(|m| m.disparity < 0).count() * 100 >= all.len() * 98);
    assert!(matches::find(&swapped, None, Some(case.range)).len() < 10);
}

#[test]
fn masked_pixels_are_never_used() {
    let case = Case::scene("slanted");
    let (width, height) = case.pair.size();
    let hide = |image: &Image, left: usize, junk: u16| {
        let inside = |x: usize, y: usize| (left..left + 40).contains(&x) && (50..110).contains(&y);
        Image {
            pixels: Plane::from_fn(width, height, |x, y| {
                if inside(x, y) { [(x * 7919 + y * 104_729) as u16 & junk; 4] } else { image.pixels[(x, y)] }
            }),
            masked: Plane::from_fn(width, height, inside),
        }
    };
    let found = |junk: u16| {
        let pair = Pair::new(hide(case.pair.left(), 60, junk), hide(case.pair.right(), 130, junk)).unwrap();
        matches::find(&pair, None, Some(case.range))
    };
    let clean = found(0);
    assert_eq!(clean, found(0xffff));
    assert!(clean.len() > 200);
    let near = |m: &SparseMatch| (57..103).contains(&m.x) && (47..113).contains(&m.y);
    assert!(!clean.iter().any(near));
    assert!(matches::find(&case.pair, None, Some(case.range)).iter().any(near));
}

#[test]
fn pixels_of_no_zone_give_no_match() {
    let case = Case::scene("slanted");
    let (width, height) = case.pair.size();
    let zones = Plane::from_fn(width, height, |x, _| u32::from(x >= 120));
    let beyond = |count| {
        let found = matches::find(&case.pair, Some((&zones, count)), Some(case.range));
        assert!(found.iter().any(|m| m.x < 120));
        found.iter().any(|m| m.x >= 120)
    };
    assert!(beyond(2) && !beyond(1));
}

#[test]
fn pairs_without_texture_have_no_match() {
    let noise = |width, height| {
        Image::from_rgb8(&Plane::from_fn(width, height, |x, y| {
            let v = (x * x * 31 + y * y * 17 + x * y * 13) as u8;
            [v, v.wrapping_mul(3), v ^ 0x55]
        }))
    };
    let mut masked = noise(60, 50);
    masked.masked = Plane::filled(60, 50, true);
    let plain = Image::from_rgb8(&Plane::filled(60, 50, [90, 120, 30]));
    for image in [noise(1, 1), noise(3, 40), noise(40, 3), noise(7, 7), plain, masked] {
        let pair = Pair::new(image.clone(), image).unwrap();
        for range in
            [None, Some(DisparityRange::new(-5, 9).unwrap()), Some(DisparityRange::new(0, 0).unwrap())]
        {
            assert_eq!(matches::find(&pair, None, range), [], "{:?}", pair.size());
        }
        not_found(&pair);
        let told =
            |w: &Warning| matches!(w, Warning::Identical | Warning::Plain { .. } | Warning::Masked { .. });
        let said = check::warnings(&pair, None);
        assert!(said.iter().all(told), "{said:?}");
    }
    // Control: the noise itself can be matched.
    let pair = Pair::new(noise(60, 50), noise(60, 50)).unwrap();
    assert!(!matches::find(&pair, None, None).is_empty());
    // Views of different scenes cannot be matched.
    let (left, right) = (Case::scene("slanted"), Case::scene("thin"));
    let strangers = Pair::new(left.pair.left().clone(), right.pair.right().clone()).unwrap();
    not_found(&strangers);
}

/// Checks that sparse matches give no range.
fn not_found(pair: &Pair) {
    let found = check::range(pair);
    assert!(matches!(found, Err(Error::Range(RangeError::NotFound { .. }))), "{found:?}");
}

/// Matches at (0, 0), (1, 0) and so on.
fn matches_of(disparities: &[i32]) -> Vec<SparseMatch> {
    let at = |(x, &disparity): (usize, &i32)| SparseMatch { x, y: 0, disparity, dy: 0, score: 1.0 };
    disparities.iter().enumerate().map(at).collect()
}

#[test]
fn supports_are_mu_plus_minus_k_sigma() {
    let range = DisparityRange::new(-4, 20).unwrap();
    // Ten matches of mean 5.5 px and sigma 1.5 px in zone 0, none in zone 1, and one pixel without a zone.
    let found = matches_of(&[4, 7, 4, 7, 4, 7, 4, 7, 4, 7].map(|d| d * FRACTION));
    let zones = Plane::new(12, 1, vec![0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 7]);
    let interval = |k: f64, found: &[SparseMatch]| -> (i32, i32) {
        let label_range = label_range::zonal(range, (&zones, 2), found, k);
        for x in [10, 11] {
            assert_eq!(label_range[(x, 0)], [-4, 20]);
        }
        label_range[(9, 0)].into()
    };
    assert_eq!(interval(0.0, &found), (5, 6));
    assert_eq!(interval(1.0, &found), (4, 7));
    assert_eq!(interval(1.1, &found), (3, 8));
    assert_eq!(interval(5.0, &found), (-2, 13));
    assert_eq!(interval(100.0, &found), (-4, 20));
    assert_eq!(interval(1.0, &found[..MIN_MATCHES - 1]), (-4, 20));
    // An interval outside the range.
    assert_eq!(interval(1.0, &matches_of(&[100 * FRACTION; 10])), (-4, 20));
}

#[test]
fn a_coarse_support_is_the_hull_of_its_children() {
    let bits = |x: usize, y: usize| (x * 2_654_435_761 + y * 40_503 + x * y * 7_919) >> 7;
    for (width, height) in [(1, 1), (2, 2), (7, 5), (8, 3), (1, 6)] {
        let fine: LabelRanges = Plane::from_fn(width, height, |x, y| {
            let low = (bits(x, y) % 23) as i32 - 11;
            [low, low + (bits(y, x) % 9) as i32]
        });
        let coarse = label_range::coarser(&fine);
        assert_eq!(coarse.size(), (width.div_ceil(2), height.div_ceil(2)));
        for y in 0..coarse.height() {
            for x in 0..coarse.width() {
                let children = || {
                    (2 * y..(2 * y + 2).min(height))
                        .flat_map(move |v| (2 * x..(2 * x + 2).min(width)).map(move |u| (u, v)))
                };
                let least = children().map(|c| fine[c][0]).min().unwrap();
                let most = children().map(|c| fine[c][1]).max().unwrap();
                let [low, high] = coarse[(x, y)];
                assert!(2 * low <= least && 2 * low >= least - 1, "{low} for {least}");
                assert!(2 * high >= most && 2 * high <= most + 1, "{high} for {most}");
            }
        }
    }
}

/// The percentage of true disparities inside the label ranges, and the percentage of labels kept.
fn supported(case: &Case, k: f64) -> (f64, f64) {
    let zones = crude_zones(case.pair.left());
    let found = matches::find(&case.pair, Some((&zones, 15)), Some(case.range));
    let label_range = label_range::zonal(case.range, (&zones, 15), &found, k);
    let bounds = label_range.data();
    let inside =
        case.truth.data().iter().zip(bounds).filter(|(t, [low, high])| {
            t.is_finite() && (*low..=*high).contains(&((**t + 0.5).floor() as i32))
        });
    let left: i64 = bounds.iter().map(|[low, high]| i64::from(high - low + 1)).sum();
    let all = case.truth.data().len() * case.range.labels();
    (100.0 * inside.count() as f64 / case.truths().count() as f64, 100.0 * left as f64 / all as f64)
}

#[test]
fn supports_hold_the_truth() {
    let mut cases = real_pairs();
    cases.push(Case::scene("mixed"));
    for case in cases {
        let [one, two, three] = [1.0, 2.0, 3.0].map(|k| supported(&case, k));
        println!("{}: inside and labels left, in %: {one:?}, {two:?}, {three:?}", case.name);
        assert!(one.0 < two.0 && two.0 <= three.0 && one.1 < two.1 && two.1 < three.1, "{}", case.name);
        assert!(one.1 < 50.0 && two.0 > 90.0 && three.0 > 97.0, "{}", case.name);
    }
}

#[test]
fn the_range_holds_the_truth() {
    // The truth of real pairs has outliers: 36 pixels of Cones and one of Dolls lie far below all others.
    let scenes = SCENES.map(Case::scene).into_iter().map(|case| (case, 100.0, 3.0));
    for (case, share, most) in scenes.chain(real_pairs().into_iter().map(|case| (case, 99.95, 1.3))) {
        let range = check::range(&case.pair).unwrap();
        let low = case.truths().fold(f32::MAX, f32::min).floor() as i32;
        let high = case.truths().fold(f32::MIN, f32::max).ceil() as i32;
        let inside = case.truths().filter(|t| range.min as f32 <= *t && *t <= range.max as f32).count();
        let inside = 100.0 * inside as f64 / case.truths().count() as f64;
        println!("{}: {range:?} for {low} to {high}, {inside:.3} % inside", case.name);
        assert!(inside >= share, "{}: {range:?} for {low} to {high}", case.name);
        let labels = f64::from(high - low + 1);
        assert!((range.labels() as f64) < most * labels, "{}: {range:?} for {low} to {high}", case.name);
    }
}

/// Parallel cameras see no disparity below 0.
#[test]
fn only_converging_cameras_are_searched_below_0() {
    for case in SCENES.map(Case::scene) {
        let (width, height) = case.pair.size();
        let mut truths: Vec<f32> = case.truths().collect();
        truths.sort_by(f32::total_cmp);
        // Crops the views so that all disparities become smaller by `less`.
        let range = |less: usize| {
            let part = |image: &Image, x| image.crop(&Rect { x, y: 0..height });
            let (left, right) =
                (part(case.pair.left(), less..width), part(case.pair.right(), 0..width - less));
            check::range(&Pair::new(left, right).unwrap()).unwrap()
        };
        let parallel = range(truths[0] as usize);
        assert_eq!(parallel.min, 0, "{}", case.name);
        let less = truths[truths.len() / 4] as usize + 2;
        let converging = range(less);
        assert!(converging.min as f32 <= truths[0] - less as f32, "{}: {converging:?}", case.name);
    }
}

#[test]
fn known_cameras_see_no_point_behind_them() {
    // Two surfaces; parallel cameras would have the lower one behind them.
    let noise = |x: i32, y: i32| {
        let hash = ((x + 1000) as u32 * 73 + y as u32 * 179 + 1).wrapping_mul(0x9e37_79b9);
        [(hash >> 24) as u8; 3]
    };
    let step = |y: usize| if y < 80 { 12 } else { -9 };
    let view = |moved: bool| {
        let plane =
            Plane::from_fn(160, 100, |x, y| noise(x as i32 + if moved { step(y) } else { 0 }, y as i32));
        Image::from_rgb8(&plane)
    };
    let pair = Pair::new(view(false), view(true)).unwrap();
    let all = check::range(&pair).unwrap();
    assert!(all.min < -9 && all.max > 12, "{all:?}");
    let cut = check::range_of_cameras(&pair, 0.0).unwrap();
    assert!(cut.min == 0 && cut.max > 12 && cut.max < all.max, "{cut:?}");
    // The cameras have nothing behind them, or nearly everything; then they are not the cameras of the pair.
    for doffs in [40.0, -40.0] {
        assert_eq!(check::range_of_cameras(&pair, doffs).unwrap(), all, "{doffs}");
    }
}
