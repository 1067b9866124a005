use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use image::{GrayImage, ImageBuffer, Luma, LumaA, Pixel, PixelWithColorType, Rgb, RgbImage, Rgba};
use tempfile::TempDir;
use tiff::encoder::{TiffEncoder, colortype};

use super::*;
use crate::image::raster::{Raster, stretched};
use crate::image::{Image, pfm};

/// The pair of an image with itself.
fn twice(path: &Path) -> Pair {
    Pair::open(path, path).unwrap()
}

fn pair(left: &Path, right: &Path, mask: Option<&Path>) -> Result<Pair> {
    Reader::default().pair(left, right, mask)
}

fn decode(bytes: &[u8]) -> std::result::Result<Raster<'static>, String> {
    super::decode(bytes, MAX_PIXELS, None).map_err(|cause| cause.to_string())
}

const W: u32 = 4;
const H: u32 = 3;
const N: usize = 12;

/// A folder for the files of one test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn bytes(&self, name: &str, bytes: &[u8]) -> PathBuf {
        fs::write(self.at(name), bytes).unwrap();
        self.at(name)
    }

    /// An image of `W` x `H` pixels.
    fn image<P: Pixel + PixelWithColorType>(&self, name: &str, values: &[P::Subpixel]) -> PathBuf
    where
        [P::Subpixel]: image::EncodableLayout,
    {
        ImageBuffer::<P, _>::from_raw(W, H, values.to_vec()).unwrap().save(self.at(name)).unwrap();
        self.at(name)
    }

    fn grey8(&self, name: &str, values: [u8; N]) -> PathBuf {
        self.image::<Luma<u8>>(name, &values)
    }

    fn grey16(&self, name: &str, values: [u16; N]) -> PathBuf {
        self.image::<Luma<u16>>(name, &values)
    }

    fn tiff<C: colortype::ColorType>(&self, name: &str, values: &[C::Inner]) -> PathBuf
    where
        [C::Inner]: tiff::encoder::TiffValue,
    {
        let mut bytes = Cursor::new(Vec::new());
        TiffEncoder::new(&mut bytes).unwrap().write_image::<C>(W, H, values).unwrap();
        self.bytes(name, bytes.get_ref())
    }
}

fn greys(image: &Image) -> Vec<u16> {
    assert!(image.pixels.data().iter().all(|[r, g, b, v]| r == v && g == v && b == v));
    image.pixels.data().iter().map(|p| p[3]).collect()
}

fn masked(image: &Image) -> Vec<usize> {
    let masked: Vec<usize> = (0..N).filter(|&i| image.masked.data()[i]).collect();
    assert!(masked.iter().all(|&i| image.pixels.data()[i] == [0; 4]), "masked pixels hold zeros");
    masked
}

fn refused<T: std::fmt::Debug>(result: Result<T>, words: &[&str]) {
    let error = result.unwrap_err().to_string();
    assert!(words.iter().all(|w| error.contains(w)), "{words:?} in: {error}");
    assert!(!error.contains('\n'), "one line: {error}");
}

const RAMP: [u8; N] = [0, 1, 2, 3, 50, 99, 100, 127, 128, 200, 254, 255];

#[test]
fn eight_bits_are_shifted() {
    let f = Folder::new();
    let left = f.grey8("l.png", RAMP);
    let right = f.grey8("r.tif", RAMP.map(|v| 255 - v));
    let pair = pair(&left, &right, None).unwrap();
    assert_eq!(greys(pair.left()), RAMP.map(|v| (v as u16) << 8));
    assert_eq!(greys(pair.right()), RAMP.map(|v| ((255 - v) as u16) << 8));
    assert!(masked(pair.left()).is_empty() && masked(pair.right()).is_empty());
}

#[test]
fn colour_agrees_with_the_crates_grey() {
    let f = Folder::new();
    let rgb = Plane::from_fn(W as usize, H as usize, |x, y| [x as u8 * 60, y as u8 * 90, 255 - x as u8]);
    for name in ["a.png", "a.ppm", "a.tif"] {
        let pair = twice(&f.image::<Rgb<u8>>(name, rgb.data().as_flattened()));
        assert_eq!(*pair.left(), Image::from_rgb8(&rgb), "{name}");
        assert_eq!(pair.left(), pair.right());
    }
}

#[test]
fn an_8_bit_pair_times_257_is_the_same_pair() {
    let f = Folder::new();
    // A dark pair too: the free bits of its largest value must not brighten it.
    for values in [RAMP, RAMP.map(|v| v / 9)] {
        let byte = f.grey8("byte.png", values);
        let word = f.grey16("word.png", values.map(stretched));
        for (left, right) in [(&word, &word), (&byte, &word), (&word, &byte)] {
            assert_eq!(pair(left, right, None).unwrap(), twice(&byte));
        }
    }
    // Negative control: 256 is not a stretched value, and one more is a different picture.
    let byte = f.grey8("byte.png", RAMP);
    let mut values = RAMP.map(stretched);
    values[4] += 1;
    assert_ne!(twice(&f.grey16("word.png", values)), twice(&byte));
}

#[test]
fn words_use_the_whole_range() {
    let f = Folder::new();
    let values = |max: u16| -> [u16; N] { std::array::from_fn(|i| (max as usize * i / (N - 1)) as u16) };
    for (max, free) in [(65535, 0), (40000, 0), (32767, 1), (2047, 5), (1024, 5), (1023, 6), (200, 8), (3, 8)]
    {
        let path = f.grey16("a.png", values(max));
        assert_eq!(greys(twice(&path).left()), values(max).map(|v| v << free), "{max}");
        // The brighter image determines the shift of both.
        let dim = f.grey16("b.tif", values(max / 5));
        for pair in [pair(&dim, &path, None).unwrap(), pair(&path, &dim, None).unwrap()] {
            let (l, r) = (greys(pair.left()), greys(pair.right()));
            let [low, high] = if l[N - 1] < r[N - 1] { [l, r] } else { [r, l] };
            assert_eq!(low, values(max / 5).map(|v| v << free), "{max}");
            assert_eq!(high, values(max).map(|v| v << free), "{max}");
        }
    }
}

#[test]
fn an_8_bit_image_with_a_16_bit_one_is_stretched() {
    let f = Folder::new();
    let byte = f.grey8("l.png", RAMP);
    let word = f.grey16("r.png", RAMP.map(|v| v as u16 * 200));
    let pair = pair(&byte, &word, None).unwrap();
    assert_eq!(greys(pair.left()), RAMP.map(stretched));
    assert_eq!(greys(pair.right()), RAMP.map(|v| v as u16 * 200));
}

#[test]
fn views_of_8_bits_and_of_fewer_than_16_bits_both_fill_the_range() {
    let f = Folder::new();
    let byte = f.grey8("byte.png", RAMP);
    // The same picture in 12 bits.
    let word = f.grey16("word.png", RAMP.map(|v| u16::from(v) * 16 + 3));
    for (left, right, bytes) in [(&byte, &word, 0), (&word, &byte, 1)] {
        let pair = pair(left, right, None).unwrap();
        let views = [greys(pair.left()), greys(pair.right())];
        assert_eq!(views[bytes], RAMP.map(stretched));
        assert_eq!(views[1 - bytes], RAMP.map(|v| (u16::from(v) * 16 + 3) << 4));
        // They differ by less than a level.
        assert!(views[0].iter().zip(&views[1]).all(|(l, r)| l.abs_diff(*r) <= 208));
    }
    // Words with the values of bytes count as bytes.
    let wide = f.grey16("wide.png", RAMP.map(u16::from));
    assert_eq!(pair(&byte, &wide, None).unwrap(), twice(&byte));
}

#[test]
fn masked_pixels_influence_nothing() {
    let f = Folder::new();
    let mask = f.grey8("mask.png", [0, 0, 255, 0, 0, 0, 0, 1, 0, 0, 0, 0]);
    let right = f.grey16("r.png", std::array::from_fn(|i| 100 * i as u16));
    let mut results = Vec::new();
    for wild in [0, 1, 1500, 65535] {
        let mut values = std::array::from_fn(|i| 101 * i as u16);
        (values[2], values[7]) = (wild, wild);
        let pair = pair(&f.grey16("l.png", values), &right, Some(&mask)).unwrap();
        assert_eq!(masked(pair.left()), [2, 7]);
        assert!(masked(pair.right()).is_empty());
        results.push(pair);
    }
    assert!(results.iter().all(|r| *r == results[0]));
    // Negative control: without the mask they differ.
    assert_ne!(pair(&f.at("l.png"), &right, None).unwrap(), results[0]);

    let mut floats = Vec::new();
    let right = f.tiff::<colortype::Gray32Float>("r.tif", &[5.0; N]);
    for wild in [0.0, -1e30, f32::MAX, f32::NAN] {
        let mut values: [f32; N] = std::array::from_fn(|i| i as f32);
        (values[2], values[7]) = (wild, wild);
        let left = f.tiff::<colortype::Gray32Float>("l.tif", &values);
        floats.push(pair(&left, &right, Some(&mask)).unwrap());
    }
    assert!(floats.iter().all(|r| *r == floats[0]));
}

#[test]
fn transparent_pixels_are_masked() {
    let f = Folder::new();
    let alpha = |i: usize| if i == 3 { 0 } else { 1 + i as u8 };
    let la: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], alpha(i)]).collect();
    let rgba: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], RAMP[i], RAMP[i], alpha(i)]).collect();
    let wide = |v: &[u8]| v.iter().map(|&v| stretched(v)).collect::<Vec<u16>>();
    let floats: Vec<f32> = rgba.iter().map(|&v| v as f32).collect();
    let (plain, mask) = (f.grey8("plain.png", RAMP), std::array::from_fn(|i| u8::from(i == 3)));
    let expected = pair(&plain, &plain, Some(&f.grey8("mask.png", mask))).unwrap();
    for path in [
        f.image::<LumaA<u8>>("la8.png", &la),
        f.image::<Rgba<u8>>("rgba8.png", &rgba),
        f.image::<Rgba<u8>>("rgba8.tif", &rgba),
        f.image::<LumaA<u16>>("la16.png", &wide(&la)),
        f.image::<Rgba<u16>>("rgba16.tif", &wide(&rgba)),
        f.tiff::<colortype::RGBA32Float>("rgba32.tif", &floats),
    ] {
        let pair = twice(&path);
        assert_eq!(masked(pair.left()), [3], "{}", path.display());
        assert_eq!(pair.left(), expected.left(), "{}", path.display());
    }
}

#[test]
fn the_colours_of_a_mask_count_and_its_alpha_does_not() {
    let f = Folder::new();
    let mut rgba = [0, 0, 0, 255].repeat(N);
    rgba[5 * 4 + 2] = 1;
    let floats = [0.0, -0.0, f32::NAN, 1e-9, 0., 0., 0., 0., 0., 0., 0., 0.];
    for (path, expected) in [
        (f.image::<Rgba<u8>>("m.png", &rgba), &[5][..]),
        (f.tiff::<colortype::Gray32Float>("m.tif", &floats), &[2, 3]),
    ] {
        let plane = Reader::default().mask(&path).unwrap();
        assert_eq!((0..N).filter(|&i| plane.data()[i]).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn levels_are_the_upper_eight_bits() {
    let f = Folder::new();
    for path in [
        f.grey8("a.png", RAMP),
        f.grey16("b.png", RAMP.map(|v| u16::from(v) * 257)),
        f.image::<Rgb<u8>>("c.png", RAMP.map(|v| [v; 3]).as_flattened()),
    ] {
        assert_eq!(grey8(&path).unwrap().data(), RAMP);
    }
    refused(grey8(&f.tiff::<colortype::Gray32Float>("d.tif", &[0.0; N])), &["d.tif", "float"]);
}

#[test]
fn floats_are_spread_jointly() {
    let f = Folder::new();
    let left: [f32; N] = [0.0, 0.25, 0.5, f32::NAN, 0., 0., 0., 0., 0., 0., 0., 0.];
    let right: [f32; N] = [-1.0, 1.0, f32::INFINITY, f32::NEG_INFINITY, 0., 0., 0., 0., 0., 0., 0., 0.];
    let l = f.tiff::<colortype::Gray32Float>("l.tif", &left);
    let r = f.at("r.pfm");
    pfm::write(&r, &Plane::new(W as usize, H as usize, right.to_vec())).unwrap();
    let both = pair(&l, &r, None).unwrap();
    assert_eq!(greys(both.left())[..4], [32640, 40800, 48960, 0]);
    assert_eq!(greys(both.right())[..5], [0, 65280, 0, 0, 32640]);
    assert_eq!((masked(both.left()), masked(both.right())), (vec![3], vec![2, 3]));

    // Doubles beyond the range of floats, whose difference exceeds the range of doubles.
    let wide = f.tiff::<colortype::Gray64Float>(
        "d.tif",
        &[-1.7e308, 1.7e308, 0.0, f64::NAN, 0., 0., 0., 0., 0., 0., 0., 0.],
    );
    assert_eq!(greys(twice(&wide).left())[..4], [0, 65280, 32640, 0]);
}

#[test]
fn constant_and_wholly_masked_floats_are_black() {
    let f = Folder::new();
    for value in [7.5, 0.0, f32::NAN, f32::MAX] {
        let pair = twice(&f.tiff::<colortype::Gray32Float>("a.tif", &[value; N]));
        assert_eq!(greys(pair.left()), [0; N], "{value}");
        assert_eq!(masked(pair.left()).len(), if value.is_nan() { N } else { 0 });
    }
}

#[test]
fn float_colours_and_signed_words() {
    let f = Folder::new();
    let rgb: Vec<f64> = (0..N * 3).map(|i| i as f64).collect();
    let double = f.tiff::<colortype::RGB64Float>("d.tif", &rgb);
    let float = f.tiff::<colortype::RGB32Float>("f.tif", &rgb.iter().map(|&v| v as f32).collect::<Vec<_>>());
    let pair = pair(&double, &float, None).unwrap();
    assert_eq!(pair.left(), pair.right());
    assert_eq!((pair.left().pixels[(0, 0)][0], pair.left().pixels[(3, 2)][2]), (0, 65280));
    let signed: Vec<i16> = (0..N as i16).map(|i| i * 100 - 500).collect();
    let signed = greys(twice(&f.tiff::<colortype::GrayI16>("s.tif", &signed)).left());
    assert_eq!((signed[0], signed[N - 1]), (0, 65280));
}

#[test]
fn the_content_decides_the_kind() {
    let f = Folder::new();
    let expected = f.grey8("a.png", RAMP);
    fs::copy(&expected, f.at("a.jpg")).unwrap();
    fs::copy(&expected, f.at("a")).unwrap();
    let text: Vec<String> = RAMP.iter().map(u8::to_string).collect();
    let pgm = f.bytes("a.tif", format!("P2\n# by hand\n4 3\n255\n{}\n", text.join(" ")).as_bytes());
    let expected = twice(&expected);
    assert_eq!(pair(&f.at("a.jpg"), &f.at("a"), None).unwrap(), expected);
    assert_eq!(twice(&pgm), expected);
}

#[test]
fn jpeg_is_read_and_truncation_is_found() {
    let f = Folder::new();
    let image = RgbImage::from_fn(64, 48, |x, y| Rgb([x as u8 * 4, y as u8 * 5, 128]));
    let path = f.at("a.jpg");
    image.save(&path).unwrap();
    assert_eq!(twice(&path).size(), (64, 48));
    let whole = fs::read(&path).unwrap();
    for cut in [1, 2, 50, whole.len() / 2, whole.len() - 4] {
        let path = f.bytes("cut.jpg", &whole[..whole.len() - cut]);
        refused(pair(&path, &path, None), &["cut.jpg", "get the file again"]);
    }
}

#[test]
fn mismatched_images_are_refused() {
    let f = Folder::new();
    let left = f.grey8("left.png", RAMP);
    let small = f.at("small.png");
    GrayImage::new(2, 3).save(&small).unwrap();
    refused(pair(&left, &small, None), &["left.png is 4 x 3", "small.png is 2 x 3"]);
    refused(pair(&left, &left, Some(&small)), &["small.png is 2 x 3", "left.png is 4 x 3", "mask"]);
    let float = f.tiff::<colortype::Gray32Float>("float.tif", &[0.0; N]);
    refused(pair(&left, &float, None), &["left.png", "float.tif", "the same format"]);
}

#[test]
fn files_that_are_no_images_are_refused() {
    let f = Folder::new();
    let good = f.grey8("good.png", RAMP);
    let bad = |path: &Path, words: &[&str]| {
        refused(pair(path, &good, None), words);
        refused(pair(&good, path, None), words);
        refused(pair(&good, &good, Some(path)), words);
        refused(read_disparity(path), words);
    };
    bad(&f.at("missing.png"), &["missing.png", "no such file"]);
    bad(f.0.path(), &["folder"]);
    for (name, bytes, word) in [
        ("empty.png", &b""[..], "is empty"),
        ("text.png", b"What is this?\nNo image.\n", "PNG, JPEG, PNM, TIFF, BMP, PFM or NPY"),
        (
            "a.png",
            b"GIF89a.....................",
            "is a GIF image, which is not supported: convert it to PNG",
        ),
        ("huge.pgm", b"P5\n4000000000 4000000000\n255\n", "at most"),
        ("none.pgm", b"P5\n0 5\n255\n", ""),
        ("lie.pgm", b"P5\n16384 16384\n255\n", "get the file again"),
        ("large.pgm", b"P5\n16385 16384\n255\n", "16385 x 16384"),
        ("large.pgm", b"P5\n16385 16384\n255\n", "at most 268435456"),
        ("short.pgm", b"P5\n30 30\n255\n1234", ""),
        ("huge.pfm", b"Pf\n2000000000 2000000000\n-1\n", "at most"),
    ] {
        bad(&f.bytes(name, bytes), &[name, word]);
    }
    #[cfg(target_os = "linux")]
    bad(Path::new("/dev/zero"), &["not an image"]);
    // A PNG whose header claims too much.
    let mut png = fs::read(&good).unwrap();
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    bad(&f.bytes("huge.png", &png), &["huge.png"]);
}

/// One small file of each kind.
fn samples(f: &Folder) -> Vec<Vec<u8>> {
    pfm::write(&f.at("a.pfm"), &Plane::filled(4, 3, 2.0)).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    for compression in [tiff::encoder::Compression::Lzw, tiff::encoder::Compression::Packbits] {
        bytes = Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.with_compression(compression).write_image::<colortype::Gray16>(W, H, &[300; N]).unwrap();
    }
    let greys = ["a.png", "a.pgm", "a.tif", "a.jpg"].map(|name| f.grey8(name, RAMP));
    let colours = f.tiff::<colortype::RGB32Float>("b.tif", &[1.5; N * 3]);
    let files = greys.into_iter().chain([colours, f.at("a.pfm"), f.bytes("c.tif", bytes.get_ref())]);
    files.map(|path| fs::read(path).unwrap()).collect()
}

#[test]
fn every_truncation_is_an_error() {
    for whole in samples(&Folder::new()) {
        assert!(decode(&whole).is_ok());
        // The trailer of a PNG file says nothing about its pixels.
        let end = if whole.starts_with(b"\x89PNG") { whole.len() - 12 } else { whole.len() };
        for length in 0..end {
            assert!(decode(&whole[..length]).is_err(), "{length} bytes of {:?}", &whole[..4]);
        }
    }
}

#[test]
fn damaged_files_never_panic_and_never_lie_about_their_size() {
    let mut state = 1_u32;
    let mut random = move |n: usize| {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as usize % n
    };
    for whole in samples(&Folder::new()) {
        for _ in 0..4000 {
            let mut bytes = whole.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                bytes[at] = [0, 1, 0x7f, 0x80, 0xff, random(256) as u8][random(6)];
            }
            match decode(&bytes) {
                Ok(raster) => {
                    assert_eq!(raster.samples.len(), raster.width * raster.height * raster.channels);
                }
                Err(reason) => assert!(!reason.contains('\n')),
            }
        }
    }
}

#[test]
fn disparities_of_unknown_scale_are_refused() {
    let f = Folder::new();
    for (path, words) in [
        (f.grey8("d.png", RAMP), &["d.png", "whole numbers", "16-bit"][..]),
        (f.grey16("d.tif", [9; N]), &["d.tif", "float .tif"]),
        (f.grey8("d.pgm", RAMP), &["d.pgm", ".pfm"]),
        (f.image::<Rgb<u16>>("flow.png", &[0; 3 * N]), &["flow.png", "more than one channel"]),
    ] {
        refused(read_disparity(&path), words);
    }
    let word = f.grey16("k.png", [0, 1, 256, 65535, 0, 0, 0, 0, 0, 0, 0, 128]);
    let map = read_disparity(&word).unwrap();
    let i = f32::INFINITY;
    assert_eq!(map.data(), [i, 1.0 / 256.0, 1.0, 65535.0 / 256.0, i, i, i, i, i, i, i, 0.5]);
    let double = f.tiff::<colortype::Gray64Float>(
        "d.tif",
        &[1.5, f64::NAN, f64::NEG_INFINITY, 1e300, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    );
    assert_eq!(read_disparity(&double).unwrap().data()[..6], [1.5, i, i, i, -2.0, 0.0]);
}

#[test]
fn levels_become_disparities_by_their_scale() {
    let f = Folder::new();
    let i = f32::INFINITY;
    let scaled = |path: &Path| Reader::default().scaled_disparity(path, 3.0);
    let map = scaled(&f.grey8("d.png", [0, 1, 3, 255, 0, 0, 0, 0, 0, 0, 0, 6])).unwrap();
    assert_eq!(map.data(), [i, 1.0 / 3.0, 1.0, 85.0, i, i, i, i, i, i, i, 2.0]);
    for path in [f.grey8("d.pgm", RAMP), f.at("none.png")] {
        assert!(scaled(&path).is_err(), "{}", path.display());
    }
    // The scale of 16 bits may differ from KITTI's, and TIFF has no default.
    for path in [f.grey16("k.png", [9; N]), f.grey16("k.tif", [9; N])] {
        assert_eq!(scaled(&path).unwrap().data(), [3.0; N], "{}", path.display());
    }
    let path = f.at("f.pfm");
    pfm::write(&path, &Plane::filled(2, 2, 1.0)).unwrap();
    refused(scaled(&path), &["f.pfm", "in pixels", "whole numbers"]);
}

/// Changing a byte of the coded data of a JPEG file, which the decoder hardly ever notices, gives a doubt
/// with the name of the file, unless the lengths do not change. A sound file has no doubt.
#[test]
fn damaged_jpeg_data_is_a_doubt() {
    let f = Folder::new();
    let noise = GrayImage::from_fn(64, 64, |x, y| {
        Luma([(x * 7919 + y * 104_729).wrapping_mul(0x9e37_79b9).to_be_bytes()[0]])
    });
    let mut file = Cursor::new(Vec::new());
    noise.write_to(&mut file, ImageFormat::Jpeg).unwrap();
    let sound = file.into_inner();
    let start = sound.windows(2).position(|two| two == [0xff, 0xda]).unwrap() + 16;
    let path = f.bytes("sound.jpg", &sound);
    assert_eq!(*twice(&path).doubts(), [None, None]);
    let (mut tried, mut silent) = (0, 0);
    for at in (start..sound.len() - 40).step_by(7) {
        let mut damaged = sound.clone();
        damaged[at] ^= 0x55;
        let Ok(pair) = pair(&path, &f.bytes("damaged.jpg", &damaged), None) else { continue };
        let [left, right] = pair.doubts();
        assert_eq!(*left, None);
        assert!(
            right.iter().all(|doubt| doubt.contains("damaged.jpg: the JPEG data is damaged: ")),
            "{right:?}"
        );
        (tried, silent) = (tried + 1, silent + usize::from(right.is_none()));
        // Derived pairs keep the doubt.
        assert_eq!(pair.crop(&crate::image::Rect::whole((9, 9))).doubts(), pair.doubts());
    }
    assert!(tried > 100 && silent * 2 < tried, "{silent} of {tried}");
}

/// BMP, which is common in machine vision, and NumPy arrays are read wherever other images are.
#[test]
fn bitmaps_and_arrays_are_read() {
    let f = Folder::new();
    let grey = f.grey8("g.png", RAMP);
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 4), }";
    let npy = |kind: &str, data: &[u8]| {
        let header = header.replace("|u1", kind);
        [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
    };
    let array = f.bytes("g.npy", &npy("|u1", &RAMP));
    let bitmap = bmp(4, 3, &RAMP);
    let path = f.bytes("g.bmp", &bitmap);
    assert_eq!(twice(&array), twice(&grey));
    assert_eq!(twice(&path), twice(&grey));
    for length in 0..bitmap.len() {
        assert!(decode(&bitmap[..length]).is_err(), "{length}");
    }
    let floats: Vec<u8> = (0..12).flat_map(|v| (v as f32 / 2.0).to_le_bytes()).collect();
    let map = read_disparity(&f.bytes("d.npy", &npy("<f4", &floats))).unwrap();
    assert_eq!(map.data()[..4], [0.0, 0.5, 1.0, 1.5]);
    refused(read_disparity(&array), &["g.npy", "whole numbers"]);
    let scaled = Reader::default().scaled_disparity(&array, 2.0).unwrap();
    assert_eq!(scaled.data()[11..], [f32::from(RAMP[11]) / 2.0]);
    let mask = Reader::default()
        .mask(&f.bytes("m.npy", &npy("|b1", &[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1])))
        .unwrap();
    assert_eq!(mask.data().iter().filter(|masked| **masked).count(), 2);
}

/// An 8-bit bitmap with a palette of greys, the bottom row first.
fn bmp(width: u32, height: u32, levels: &[u8]) -> Vec<u8> {
    let start = 54 + 4 * 256_u32;
    let row = width.next_multiple_of(4);
    let mut bytes = b"BM".to_vec();
    for v in [start + row * height, 0, start, 40, width, height, 1 | 8 << 16, 0, row * height, 0, 0, 256, 0] {
        bytes.extend(v.to_le_bytes());
    }
    (0..=255).for_each(|v| bytes.extend([v, v, v, 0]));
    for line in levels.chunks(width as usize).rev() {
        bytes.extend(line);
        bytes.extend(vec![0; (row - width) as usize]);
    }
    bytes
}
