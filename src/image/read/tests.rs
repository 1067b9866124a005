use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use image::{GrayAlphaImage, GrayImage, ImageBuffer, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
use tempfile::TempDir;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::{ExtraSamples, Tag};

use super::*;
use crate::image::raster::{Raster, stretched};
use crate::image::{Image, pfm};

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

    fn grey8(&self, name: &str, values: [u8; N]) -> PathBuf {
        GrayImage::from_raw(W, H, values.to_vec()).unwrap().save(self.at(name)).unwrap();
        self.at(name)
    }

    fn grey16(&self, name: &str, values: [u16; N]) -> PathBuf {
        ImageBuffer::<Luma<u16>, _>::from_raw(W, H, values.to_vec()).unwrap().save(self.at(name)).unwrap();
        self.at(name)
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
        RgbImage::from_raw(W, H, rgb.data().as_flattened().to_vec()).unwrap().save(f.at(name)).unwrap();
        let pair = pair(&f.at(name), &f.at(name), None).unwrap();
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
        let expected = pair(&byte, &byte, None).unwrap();
        assert_eq!(pair(&word, &word, None).unwrap(), expected);
        assert_eq!(pair(&byte, &word, None).unwrap(), expected);
        assert_eq!(pair(&word, &byte, None).unwrap(), expected);
    }
    // Negative control: 256 is no stretching, and one more is a different picture.
    let byte = f.grey8("byte.png", RAMP);
    let mut values = RAMP.map(stretched);
    values[4] += 1;
    let word = f.grey16("word.png", values);
    assert_ne!(pair(&word, &word, None).unwrap(), pair(&byte, &byte, None).unwrap());
}

#[test]
fn words_use_the_whole_range() {
    let f = Folder::new();
    let values = |max: u16| -> [u16; N] { std::array::from_fn(|i| (max as usize * i / (N - 1)) as u16) };
    for (max, free) in [(65535, 0), (40000, 0), (32767, 1), (2047, 5), (1024, 5), (1023, 6), (200, 8), (3, 8)]
    {
        let path = f.grey16("a.png", values(max));
        let same = pair(&path, &path, None).unwrap();
        assert_eq!(greys(same.left()), values(max).map(|v| v << free), "{max}");
        // The brighter of the two decides for both.
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
fn what_is_masked_influences_nothing() {
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
    GrayAlphaImage::from_raw(W, H, la.clone()).unwrap().save(f.at("la8.png")).unwrap();
    RgbaImage::from_raw(W, H, rgba.clone()).unwrap().save(f.at("rgba8.png")).unwrap();
    RgbaImage::from_raw(W, H, rgba.clone()).unwrap().save(f.at("rgba8.tif")).unwrap();
    ImageBuffer::<LumaA<u16>, _>::from_raw(W, H, wide(&la)).unwrap().save(f.at("la16.png")).unwrap();
    ImageBuffer::<Rgba<u16>, _>::from_raw(W, H, wide(&rgba)).unwrap().save(f.at("rgba16.tif")).unwrap();
    let floats: Vec<f32> = rgba.iter().map(|&v| v as f32).collect();
    f.tiff::<colortype::RGBA32Float>("rgba32.tif", &floats);

    let plain = f.grey8("plain.png", RAMP);
    let expected =
        pair(&plain, &plain, Some(&f.grey8("mask.png", std::array::from_fn(|i| u8::from(i == 3)))));
    let expected = expected.unwrap();
    for name in ["la8.png", "rgba8.png", "rgba8.tif", "la16.png", "rgba16.tif", "rgba32.tif"] {
        let pair = pair(&f.at(name), &f.at(name), None).unwrap();
        assert_eq!(masked(pair.left()), [3], "{name}");
        assert_eq!(pair.left(), expected.left(), "{name}");
    }
}

#[test]
fn the_colours_of_a_mask_count_and_its_alpha_does_not() {
    let f = Folder::new();
    let mut rgba = [0, 0, 0, 255].repeat(N);
    rgba[5 * 4 + 2] = 1;
    RgbaImage::from_raw(W, H, rgba).unwrap().save(f.at("m.png")).unwrap();
    let plane = Reader::default().mask(&f.at("m.png")).unwrap();
    assert_eq!((0..N).filter(|&i| plane.data()[i]).collect::<Vec<_>>(), [5]);
    let path = f.tiff::<colortype::Gray32Float>(
        "m.tif",
        &[0.0, -0.0, f32::NAN, 1e-9, 0., 0., 0., 0., 0., 0., 0., 0.],
    );
    let plane = Reader::default().mask(&path).unwrap();
    assert_eq!((0..N).filter(|&i| plane.data()[i]).collect::<Vec<_>>(), [2, 3]);
}

#[test]
fn levels_are_the_upper_eight_bits() {
    let f = Folder::new();
    assert_eq!(grey8(&f.grey8("a.png", RAMP)).unwrap().data(), RAMP);
    let words = f.grey16("b.png", RAMP.map(|v| u16::from(v) * 257));
    assert_eq!(grey8(&words).unwrap().data(), RAMP);
    let colours = RAMP.iter().flat_map(|&v| [v; 3]).collect();
    RgbImage::from_raw(W, H, colours).unwrap().save(f.at("c.png")).unwrap();
    assert_eq!(grey8(&f.at("c.png")).unwrap().data(), RAMP);
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
    assert_eq!(greys(pair(&wide, &wide, None).unwrap().left())[..4], [0, 65280, 32640, 0]);
}

#[test]
fn constant_and_wholly_masked_floats_are_black() {
    let f = Folder::new();
    for value in [7.5, 0.0, f32::NAN, f32::MAX] {
        let path = f.tiff::<colortype::Gray32Float>("a.tif", &[value; N]);
        let pair = pair(&path, &path, None).unwrap();
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
    assert_eq!(pair.left().pixels[(0, 0)][0], 0);
    assert_eq!(pair.left().pixels[(3, 2)][2], 65280);
    let signed: Vec<i16> = (0..N as i16).map(|i| i * 100 - 500).collect();
    let signed = f.tiff::<colortype::GrayI16>("s.tif", &signed);
    let pair = self::pair(&signed, &signed, None).unwrap();
    assert_eq!((greys(pair.left())[0], greys(pair.left())[N - 1]), (0, 65280));
}

#[test]
fn tiff_with_grey_and_alpha_and_in_planes() {
    let f = Folder::new();
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<colortype::Gray8>(W, H).unwrap();
    image.extra_samples(&[ExtraSamples::UnassociatedAlpha]).unwrap();
    let la: Vec<u8> = (0..N).flat_map(|i| [RAMP[i], u8::from(i != 6)]).collect();
    image.write_data(&la).unwrap();
    let path = f.bytes("la.tif", bytes.get_ref());
    let pair = pair(&path, &path, None).unwrap();
    assert_eq!(masked(pair.left()), [6]);
    assert_eq!(greys(pair.left())[11], 255 << 8);

    let planes: Vec<u8> = [RAMP, [7; N], RAMP.map(|v| 255 - v)].concat();
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut directory = encoder.image_directory().unwrap();
    let offset = directory.write_data(planes.as_slice()).unwrap() as u32;
    let n = N as u32;
    directory.write_tag(Tag::ImageWidth, W).unwrap();
    directory.write_tag(Tag::ImageLength, H).unwrap();
    directory.write_tag(Tag::BitsPerSample, [8_u16; 3].as_slice()).unwrap();
    directory.write_tag(Tag::PhotometricInterpretation, 2_u16).unwrap();
    directory.write_tag(Tag::SamplesPerPixel, 3_u16).unwrap();
    directory.write_tag(Tag::PlanarConfiguration, 2_u16).unwrap();
    directory.write_tag(Tag::StripOffsets, [offset, offset + n, offset + 2 * n].as_slice()).unwrap();
    directory.write_tag(Tag::StripByteCounts, [n; 3].as_slice()).unwrap();
    directory.finish().unwrap();
    let path = f.bytes("planes.tif", bytes.get_ref());
    let pair = self::pair(&path, &path, None).unwrap();
    assert_eq!(pair.left().pixels[(1, 2)][..3], [200 << 8, 7 << 8, 55 << 8]);
}

#[test]
fn the_content_decides_and_not_the_name() {
    let f = Folder::new();
    let expected = f.grey8("a.png", RAMP);
    fs::copy(&expected, f.at("a.jpg")).unwrap();
    fs::copy(&expected, f.at("a")).unwrap();
    let text: Vec<String> = RAMP.iter().map(u8::to_string).collect();
    let pgm = f.bytes("a.tif", format!("P2\n# by hand\n4 3\n255\n{}\n", text.join(" ")).as_bytes());
    let expected = pair(&expected, &expected, None).unwrap();
    assert_eq!(pair(&f.at("a.jpg"), &f.at("a"), None).unwrap(), expected);
    assert_eq!(pair(&pgm, &pgm, None).unwrap(), expected);
}

#[test]
fn jpeg_is_read_and_its_end_is_missed() {
    let f = Folder::new();
    let image = RgbImage::from_fn(64, 48, |x, y| Rgb([x as u8 * 4, y as u8 * 5, 128]));
    let path = f.at("a.jpg");
    image.save(&path).unwrap();
    assert_eq!(pair(&path, &path, None).unwrap().size(), (64, 48));
    let whole = fs::read(&path).unwrap();
    for cut in [1, 2, 50, whole.len() / 2, whole.len() - 4] {
        let path = f.bytes("cut.jpg", &whole[..whole.len() - cut]);
        refused(pair(&path, &path, None), &["cut.jpg", "get the file again"]);
    }
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let f = Folder::new();
    let left = f.grey8("left.png", RAMP);
    let small = f.at("small.png");
    GrayImage::new(2, 3).save(&small).unwrap();
    refused(pair(&left, &small, None), &["left.png is 4 x 3", "small.png is 2 x 3"]);
    refused(pair(&left, &left, Some(&small)), &["small.png is 2 x 3", "left.png is 4 x 3", "mask"]);
    let float = f.tiff::<colortype::Gray32Float>("float.tif", &[0.0; N]);
    refused(pair(&left, &float, None), &["left.png", "float.tif", "one format"]);
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
    bad(&f.bytes("empty.png", b""), &["empty.png", "is empty"]);
    bad(&f.bytes("text.png", b"What is this?\nNo image.\n"), &["text.png", "PNG, JPEG, PNM, TIFF or PFM"]);
    bad(&f.bytes("a.png", b"GIF89a....................."), &["gif", "PNG, JPEG, PNM, TIFF or PFM"]);
    bad(&f.bytes("huge.pgm", b"P5\n4000000000 4000000000\n255\n"), &["huge.pgm", "at most"]);
    bad(&f.bytes("none.pgm", b"P5\n0 5\n255\n"), &["none.pgm"]);
    bad(&f.bytes("lie.pgm", b"P5\n16384 16384\n255\n"), &["lie.pgm", "get the file again"]);
    bad(
        &f.bytes("large.pgm", b"P5\n16385 16384\n255\n"),
        &["large.pgm", "16385 x 16384", "at most 268435456"],
    );
    bad(&f.bytes("short.pgm", b"P5\n30 30\n255\n1234"), &["short.pgm"]);
    bad(&f.bytes("huge.pfm", b"Pf\n2000000000 2000000000\n-1\n"), &["huge.pfm", "at most"]);
    #[cfg(target_os = "linux")]
    bad(Path::new("/dev/zero"), &["not an image"]);
    // A PNG whose header claims too much.
    let mut png = fs::read(&good).unwrap();
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    bad(&f.bytes("huge.png", &png), &["huge.png"]);
}

/// One small file of each kind.
fn samples(f: &Folder) -> Vec<Vec<u8>> {
    f.grey8("a.png", RAMP);
    f.grey8("a.pgm", RAMP);
    f.grey8("a.tif", RAMP);
    f.grey8("a.jpg", RAMP);
    f.tiff::<colortype::RGB32Float>("b.tif", &[1.5; N * 3]);
    pfm::write(&f.at("a.pfm"), &Plane::filled(4, 3, 2.0)).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    for compression in [tiff::encoder::Compression::Lzw, tiff::encoder::Compression::Packbits] {
        bytes = Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut bytes).unwrap();
        encoder.with_compression(compression).write_image::<colortype::Gray16>(W, H, &[300; N]).unwrap();
    }
    let mut files: Vec<_> = ["a.png", "a.pgm", "a.tif", "a.jpg", "b.tif", "a.pfm"]
        .map(|name| fs::read(f.at(name)).unwrap())
        .into();
    files.push(bytes.into_inner());
    files
}

#[test]
fn every_truncation_is_an_error() {
    for whole in samples(&Folder::new()) {
        assert!(decode(&whole).is_ok());
        // The trailer of a PNG file says nothing about its pixels.
        let end = if whole.starts_with(b"\x89PNG") { whole.len() - 12 } else { whole.len() };
        for length in 0..end {
            assert!(
                decode(&whole[..length]).is_err(),
                "{length} of {} bytes: {:?}",
                whole.len(),
                &whole[..4]
            );
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
                    let n = raster.width * raster.height * raster.channels;
                    assert_eq!(raster.samples.len(), n);
                }
                Err(reason) => assert!(!reason.contains('\n')),
            }
        }
    }
}

#[test]
fn disparities_are_refused_where_their_scale_is_unknown() {
    let f = Folder::new();
    refused(read_disparity(&f.grey8("d.png", RAMP)), &["d.png", "8-bit PNG", "16-bit"]);
    refused(read_disparity(&f.grey16("d.tif", [9; N])), &["d.tif", "float .tif"]);
    refused(read_disparity(&f.grey8("d.pgm", RAMP)), &["d.pgm", ".pfm"]);
    let rgb = ImageBuffer::<Rgb<u16>, Vec<u16>>::new(W, H);
    rgb.save(f.at("flow.png")).unwrap();
    refused(read_disparity(&f.at("flow.png")), &["flow.png", "more than one channel"]);
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
    let map = Reader::default()
        .scaled_disparity(&f.grey8("d.png", [0, 1, 3, 255, 0, 0, 0, 0, 0, 0, 0, 6]), 3.0)
        .unwrap();
    assert_eq!(map.data(), [i, 1.0 / 3.0, 1.0, 85.0, i, i, i, i, i, i, i, 2.0]);
    for path in [f.grey16("k.png", [9; N]), f.grey8("d.pgm", RAMP), f.at("none.png")] {
        assert!(Reader::default().scaled_disparity(&path, 3.0).is_err(), "{}", path.display());
    }
    refused(
        Reader::default().scaled_disparity(&f.grey16("k.png", [9; N]), 4.0),
        &["k.png", "8-bit PNG", "needs a scale"],
    );
}
