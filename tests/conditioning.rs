//! Conditioning: faults of a rig are found and corrected, and sound scenes are left unchanged.

use std::path::Path;

use mrfgs::image::{Image, Pair, Plane, Rect};
use mrfgs::low_level::front::conditioning::condition;
use mrfgs::maps::FRACTION;
use mrfgs::options::DisparityRange;
use mrfgs::{Conditioning, Matcher, Method};

const RANGE: DisparityRange = DisparityRange { min: 0, max: 31 };

fn scene(name: &str) -> mrfgs::Result<Pair> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name);
    Pair::open(folder.join("im0.png"), folder.join("im1.png"))
}

fn found(pair: &Pair) -> Conditioning {
    condition(pair, RANGE, &Method::default().front).1
}

#[test]
fn sound_rigs_stay_as_they_are() {
    for name in ["slanted", "thin", "wall", "repetitive", "exposure", "light", "steep", "mixed"] {
        let pair = scene(name).unwrap();
        let (same, found) = condition(&pair, RANGE, &Method::default().front);
        assert_eq!(found, Conditioning::default(), "{name}");
        assert!(same == pair, "{name}");
        assert_eq!(found.to_string(), "", "{name}");
    }
}

#[test]
fn each_fault_is_found_in_its_scene() {
    let rows = found(&scene("rows").unwrap());
    let offset = f64::from(rows.offset) / f64::from(FRACTION);
    assert!((offset - 0.6).abs() < 0.1, "{rows:?}");
    // The description does not mention smoothing.
    assert_eq!(rows.to_string(), format!("the right view is moved up by {offset:.2} px"));
    // Defocus by 5 x 5 pixels is as wide as a Gaussian of 1.44 pixels, but noise hides part of it.
    let focus = found(&scene("focus").unwrap());
    let [left, right] = focus.smoothing;
    assert!((left * left - right * right).sqrt() > 0.6 && left < 2.0 && focus.offset == 0, "{focus:?}");
    let grain = found(&scene("grain").unwrap());
    assert_eq!(grain.offset, 0, "{grain:?}");
    assert!(grain.to_string().starts_with("both views are smoothed by"), "{grain}");
}

/// The view after JPEG compression at this quality.
fn compressed(view: &Image, quality: u8) -> Image {
    let (width, height) = view.pixels.size();
    let colours: Vec<u8> = view.to_rgb8().data().iter().flatten().copied().collect();
    let mut file = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, quality)
        .encode(&colours, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .expect("JPEG takes any colours");
    let seen = image::load_from_memory(&file).expect("what was encoded").to_rgb8();
    Image::from_rgb8(&Plane::from_fn(width, height, |x, y| seen.get_pixel(x as u32, y as u32).0))
}

/// The lower the JPEG quality, the more is smoothed, wherever the image is cropped.
#[test]
fn blocks_of_jpeg_are_smoothed() {
    let pair = scene("mixed").unwrap();
    let with = |quality: u8| Pair::new(compressed(pair.left(), quality), compressed(pair.right(), quality));
    let smoothing = |pair: &Pair| {
        let [left, right] = found(pair).smoothing;
        assert_eq!(left.to_bits(), right.to_bits());
        left
    };
    let found = [95, 50, 20, 5].map(|quality| smoothing(&with(quality).unwrap()));
    println!("{found:?}");
    assert!(found.is_sorted() && found[0] < 0.1 && found[1] > 0.4 && found[3] > 1.5, "{found:?}");
    let cut = with(5).unwrap().crop(&Rect { x: 3..300, y: 5..230 });
    assert!(smoothing(&cut) > 1.5);
}

/// Exchanging the views exchanges the sign and the side of the faults.
#[test]
fn exchanged_views_have_exchanged_faults() {
    let exchanged = |name| found(&scene(name).unwrap().mirrored());
    let (there, back) = (found(&scene("rows").unwrap()), exchanged("rows"));
    assert!((there.offset + back.offset).abs() < FRACTION / 16, "{there:?} and {back:?}");
    let (there, back) = (found(&scene("focus").unwrap()), exchanged("focus"));
    let ratio = there.smoothing[0] / back.smoothing[1];
    assert!((0.8..1.25).contains(&ratio), "{there:?} and {back:?}");
}

/// Each correction improves the scene with its fault.
#[test]
fn corrected_pairs_are_matched_better() {
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    for (name, key) in [("rows", "level-rows"), ("focus", "equal-sharpness"), ("grain", "denoise")] {
        let pair = scene(name).unwrap();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("testdata").join(name);
        let truth = mrfgs::image::read::read_disparity(&folder.join("disp0GT.pfm")).unwrap();
        let mut bad = |value: &str| {
            let mut method = Method::default();
            method.set(key, value).unwrap();
            let matched = matcher.job(&pair, RANGE).method(&method).run().unwrap();
            let map = matched.disparity();
            let errors = map.data().iter().zip(truth.data()).filter(|(d, t)| (*d - *t).abs() > 2.0).count();
            (matched.conditioning, errors as f64 / map.data().len() as f64)
        };
        let ((none, before), (some, after)) = (bad("false"), bad("true"));
        println!("{name}: bad2.0 {:.2} %, {:.2} % with {key}", 100.0 * before, 100.0 * after);
        assert!(some != none && after < 0.9 * before, "{name}: {before} and {after}");
    }
}

/// The preset `paper` switches all corrections off.
#[test]
fn the_paper_corrects_no_rig() {
    for name in ["rows", "focus", "grain"] {
        let pair = scene(name).unwrap();
        assert!(condition(&pair, RANGE, &Method::paper().front) == (pair, Conditioning::default()), "{name}");
    }
}

#[test]
fn any_image_has_an_answer() {
    let crop =
        |width: usize, height: usize| scene("grain").unwrap().crop(&Rect { x: 0..width, y: 0..height });
    for (width, height) in [(1, 1), (2, 1), (1, 40), (17, 9), (40, 3), (31, 33)] {
        let pair = crop(width, height);
        assert_eq!(condition(&pair, RANGE, &Method::default().front).0.size(), (width, height));
    }
    let blind = |mut image: Image| {
        image.masked.data_mut().fill(true);
        image
    };
    let pair = scene("mixed").unwrap();
    let pair = Pair::new(blind(pair.left().clone()), blind(pair.right().clone())).unwrap();
    assert_eq!(found(&pair), Conditioning::default());
}

/// Masked pixels may have any value.
#[test]
fn masked_pixels_do_not_count() {
    for name in ["rows", "focus", "grain"] {
        let pair = scene(name).unwrap();
        let with = |hidden: u16| {
            let cover = |image: &Image| {
                let mut image = image.clone();
                for y in 40..60 {
                    image.masked.row_mut(y)[60..90].fill(true);
                    image.pixels.row_mut(y)[60..90].fill([hidden; 4]);
                }
                image
            };
            found(&Pair::new(cover(pair.left()), cover(pair.right())).unwrap())
        };
        assert_eq!(with(0), with(65_535), "{name}");
        assert_ne!(with(0), Conditioning::default(), "{name}");
    }
}

/// Tiles are cut from the corrected pair, so the faults are those of the whole.
#[test]
fn tiles_share_the_conditioning() {
    let pair = scene("rows").unwrap();
    let mut method = Method::default();
    method.set("memory", "15").unwrap();
    let mut matcher = Matcher::builder().device("cpu").build().unwrap();
    let matched = matcher.job(&pair, RANGE).method(&method).run().unwrap();
    assert!(matched.tiles.count() > 1, "{} tile", matched.tiles.count());
    assert_eq!(matched.conditioning, found(&pair));
}
