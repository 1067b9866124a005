//! Unusual image files that users may have, read as `Reader::pair` documents.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it stands")]

#[path = "../common/files.rs"]
mod files;
mod geotiffs;
mod tiffs;

use files::{Png, exif_orientation, jpeg, tiff, tiff_data};
use mrfgs::image::read::Reader;
use mrfgs::image::{Image, Pair};
use std::path::PathBuf;
use tempfile::TempDir;

/// A temporary folder and a file in it with these bytes.
fn file(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("image");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn left(bytes: &[u8]) -> Image {
    let (_folder, path) = file(bytes);
    Pair::open(&path, &path).unwrap().left().clone()
}

/// Red, green and blue of every pixel in 8-bit levels, `None` where it is masked.
fn colours(bytes: &[u8]) -> Vec<Option<[u16; 3]>> {
    let image = left(bytes);
    let pixels = image.pixels.data().iter().zip(image.masked.data());
    pixels.map(|([r, g, b, _], masked)| (!masked).then_some([r, g, b].map(|v| v >> 8))).collect()
}

/// The grey level of every pixel, `None` where it is masked.
fn greys(bytes: &[u8]) -> Vec<Option<u16>> {
    let grey = |[r, g, b]: [u16; 3]| {
        assert!(r == g && g == b);
        r
    };
    colours(bytes).into_iter().map(|colour| colour.map(grey)).collect()
}

fn refused(bytes: &[u8], words: &[&str]) {
    let (_folder, path) = file(bytes);
    let text = Pair::open(&path, &path).unwrap_err().to_string();
    assert!(words.iter().all(|word| text.contains(word)) && !text.contains('\n'), "{text}");
}

const GREY: Png = Png { size: (0, 0), depth: 8, colour: 0, interlaced: false, chunks: &[], rows: &[] };

#[test]
fn small_depths_span_all_levels() {
    let png = |depth, row: &[u8], width| {
        let rows = [&[0], row].concat();
        greys(&Png { size: (width, 1), depth, rows: &rows, ..GREY }.bytes())
    };
    assert_eq!(png(1, &[0b0110_0000], 3), [0, 255, 255].map(Some));
    assert_eq!(png(2, &[0b0001_1011], 4), [0, 85, 170, 255].map(Some));
    assert_eq!(png(4, &[0x08, 0xf0], 3), [0, 136, 255].map(Some));
    // In PBM, 1 is black.
    assert_eq!(greys(b"P4\n3 1\n\x60"), [255, 0, 0].map(Some));
    assert_eq!(greys(b"P1\n3 1\n0 1 1\n"), [255, 0, 0].map(Some));
    // PNM files state their white level.
    assert_eq!(greys(b"P5\n3 1\n15\n\x00\x08\x0f"), [0, 136, 255].map(Some));
    assert_eq!(greys(b"P5\n2 1\n1023\n\x00\x00\x03\xff"), [0, 255].map(Some));
}

#[test]
fn palettes_are_looked_up_and_their_alpha_masks() {
    let palette: &[u8] = &[10, 20, 30, 40, 50, 60, 70, 80, 90];
    let rows = [0, 0b0001_1000];
    let indexed = Png { size: (3, 1), depth: 2, colour: 3, rows: &rows, ..GREY };
    let expected = [[10, 20, 30], [40, 50, 60], [70, 80, 90]];
    assert_eq!(colours(&Png { chunks: &[(*b"PLTE", palette)], ..indexed }.bytes()), expected.map(Some));
    let chunks: &[([u8; 4], &[u8])] = &[(*b"PLTE", palette), (*b"tRNS", &[1, 0])];
    let indexed = Png { size: (3, 1), depth: 2, colour: 3, rows: &rows, ..GREY };
    let masked = [Some(expected[0]), None, Some(expected[2])];
    assert_eq!(colours(&Png { chunks, ..indexed }.bytes()), masked);
    // A single grey level may be transparent.
    let png = Png { size: (3, 1), chunks: &[(*b"tRNS", &[0, 7])], rows: &[0, 6, 7, 8], ..GREY };
    assert_eq!(greys(&png.bytes()), [Some(6), None, Some(8)]);
}

#[test]
fn zero_alpha_masks_and_other_alpha_is_ignored() {
    let rows = [0, 5, 0, 6, 1, 7, 255];
    assert_eq!(
        greys(&Png { size: (3, 1), colour: 4, rows: &rows, ..GREY }.bytes()),
        [None, Some(6), Some(7)]
    );
    // A 16-bit alpha whose upper byte is 0 is not 0.
    let rows = [0, 9, 9, 0, 0, 9, 9, 0, 1];
    assert_eq!(
        greys(&Png { size: (2, 1), depth: 16, colour: 4, rows: &rows, ..GREY }.bytes()),
        [None, Some(9)]
    );
    let rows = [0, 1, 1, 2, 2, 3, 3, 0, 0, 1, 1, 2, 2, 3, 3, 0, 1];
    assert_eq!(
        colours(&Png { size: (2, 1), depth: 16, colour: 6, rows: &rows, ..GREY }.bytes()),
        [None, Some([1, 2, 3])]
    );
    let map = b"P7\nWIDTH 2\nHEIGHT 1\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n";
    assert_eq!(colours(&[&map[..], &[1, 2, 3, 0, 4, 5, 6, 1]].concat()), [None, Some([4, 5, 6])]);
}

#[test]
fn interlaced_rows_come_in_order() {
    // Passes 1, 4, 5, 6 and 7 of 3 x 3 pixels.
    let passes: &[&[u8]] = &[&[0, 11], &[0, 13], &[0, 31, 33], &[0, 12], &[0, 32], &[0, 21, 22, 23]];
    let png = Png { size: (3, 3), interlaced: true, rows: &passes.concat(), ..GREY };
    assert_eq!(greys(&png.bytes()), [11, 12, 13, 21, 22, 23, 31, 32, 33].map(Some));
}

#[test]
fn jpeg_of_every_colour_space() {
    let close = |bytes: &[u8], expected: [i32; 3]| {
        let image = left(bytes);
        assert_eq!((image.width(), image.height()), (8, 8));
        for [r, g, b, _] in image.pixels.data() {
            let found = [r, g, b].map(|v| i32::from(v >> 8));
            let far = found.iter().zip(expected).any(|(a, b)| (a - b).abs() > 2);
            assert!(!far, "{found:?} and not {expected:?}");
        }
    };
    close(&jpeg(&[200], None, None), [200; 3]);
    // Y, Cb, Cr by BT.601: R = Y + 1.402 (Cr - 128) and so on.
    close(&jpeg(&[120, 148, 98], None, None), [78, 134, 155]);
    // Adobe stores inverted inks: 255 is no ink. Cyan and black determine red.
    close(&jpeg(&[200, 100, 50, 128], Some(0), None), [100, 50, 25]);
    close(&jpeg(&[255 / 2, 128, 128, 255], Some(2), None), [128; 3]);
}

/// By default, the decoder would fill everything after the damage with grey.
#[test]
fn damage_within_a_jpeg_file_is_noticed() {
    let mut bytes = Vec::new();
    let noise = |x: u32, y: u32| image::Luma([(x * x * 31 + y * y * 17 + x * y * 13) as u8]);
    let picture = image::GrayImage::from_fn(64, 64, noise);
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Jpeg).unwrap();
    assert_eq!(left(&bytes).width(), 64);
    let middle = bytes.len() / 2;
    // Sixteen one bits are not a valid Huffman code.
    bytes[middle..middle + 8].copy_from_slice(&[0xff, 0, 0xff, 0, 0xff, 0, 0xff, 0]);
    refused(&bytes, &["corrupt", "get the file again"]);
}

/// Pixels are read as stored, because a pair is rectified in its stored orientation.
#[test]
fn exif_orientation_is_not_applied() {
    let turned = exif_orientation(6);
    let png = |chunks| Png { size: (3, 1), rows: &[0, 1, 2, 3], chunks, ..GREY }.bytes();
    let (plain, noted) = (png(&[]), png(&[(*b"eXIf", &turned)]));
    assert_ne!(plain, noted);
    assert_eq!((left(&noted).width(), left(&noted)), (3, left(&plain)));
    assert_eq!(left(&jpeg(&[9], None, Some(&turned))), left(&jpeg(&[9], None, None)));
}

/// With `orient`, the reader applies the orientation tag of every format to pixels and mask.
#[test]
fn a_reader_can_turn_images_upright() {
    let upright = |bytes: &[u8]| {
        let (_folder, path) = file(bytes);
        Reader { orient: true, no_data: Some(3.0), ..Reader::default() }.pair(&path, &path, None).unwrap()
    };
    let greys = |pair: &Pair| {
        let image = pair.left();
        let pixels = image.pixels.data().iter().zip(image.masked.data());
        pixels.map(|(pixel, masked)| (!masked).then_some(pixel[3] >> 8)).collect::<Vec<_>>()
    };
    // The third pixel is no data.
    for (tag, size, expected) in [
        (1, (3, 1), [Some(1), Some(2), None]),
        (2, (3, 1), [None, Some(2), Some(1)]),
        (3, (3, 1), [None, Some(2), Some(1)]),
        (6, (1, 3), [Some(1), Some(2), None]),
        (8, (1, 3), [None, Some(2), Some(1)]),
        (77, (3, 1), [Some(1), Some(2), None]),
    ] {
        let exif = exif_orientation(tag);
        let png = Png { size: (3, 1), rows: &[0, 1, 2, 3], chunks: &[(*b"eXIf", &exif)], ..GREY }.bytes();
        let tags =
            [(256, 4, 1, 3), (257, 4, 1, 1), (258, 3, 1, 8), (262, 3, 1, 1), (274, 3, 1, u32::from(tag))];
        let strip = [(273, 4, 1, tiff_data(8)), (277, 3, 1, 1), (279, 4, 1, 3)];
        let tiff = tiff(&[&tags[..], &strip].concat(), &[1, 2, 3]);
        for bytes in [png, tiff] {
            let pair = upright(&bytes);
            assert_eq!((pair.size(), greys(&pair)), (size, expected.to_vec()), "{tag}");
            assert!(pair.orientations().iter().all(|orientation| orientation.is_upright()));
        }
    }
    // All pixels of these images are equal, so only the orientation stored with the pair shows the tag.
    let (_folder, path) = file(&jpeg(&[9], None, Some(&exif_orientation(6))));
    let stored = Pair::open(&path, &path).unwrap().orientations();
    assert!(stored.iter().all(|orientation| !orientation.is_upright()));
    let (_folder, path) = file(&jpeg(&[9], None, Some(b"Exif without a head")));
    assert!(
        Pair::open(&path, &path).unwrap().orientations().iter().all(|orientation| orientation.is_upright())
    );
}

/// NaN and infinite values are masked. Of the other values, negative ones included, the smallest becomes
/// black and the largest white.
#[test]
fn extreme_float_values() {
    let pfm = |values: &[f32]| {
        let data = values.iter().flat_map(|v| v.to_le_bytes());
        format!("Pf\n{} 1\n-1\n", values.len()).into_bytes().into_iter().chain(data).collect::<Vec<u8>>()
    };
    let (nan, infinite) = (f32::NAN, f32::INFINITY);
    assert_eq!(
        greys(&pfm(&[-4.0, nan, 0.0, infinite, -infinite, 4.0])),
        [Some(0), None, Some(127), None, None, Some(255)]
    );
    assert_eq!(greys(&pfm(&[f32::MIN, f32::MAX, -0.0, 1e-45])), [0, 255, 127, 127].map(Some));
    assert_eq!(greys(&pfm(&[-3.0, -2.0, -1.0])), [0, 127, 255].map(Some));
    assert_eq!(greys(&pfm(&[nan, infinite, -infinite])), [None; 3]);
    // A pixel is masked where any of its channels is not finite.
    let data = [1.0, 2.0, nan, 1.0, 2.0, 3.0_f32].into_iter().flat_map(f32::to_le_bytes);
    let colour: Vec<u8> = b"PF\n2 1\n-1\n".iter().copied().chain(data).collect();
    assert_eq!(colours(&colour), [None, Some([0, 127, 255])]);
}
