//! TIFF: samples are read as the tags specify, or the file is rejected.

use super::files::{Tiff, Values, jpeg};
use super::{colours, file, greys, left, refused};
use Values::{Fraction, Long, Short, Text};
use mrfgs::image::read::{self, Reader};

/// An 8-bit grey file; `tags` replace or extend the required ones.
fn grey(size: [u32; 2], tags: &[(u16, Values)], chunks: &[&[u8]]) -> Vec<u8> {
    image(size, &[(258, Short(&[8])), (262, Short(&[1]))], tags, chunks, false)
}

fn rgb(size: [u32; 2], tags: &[(u16, Values)], chunks: &[&[u8]]) -> Vec<u8> {
    let usual = [(258, Short(&[8, 8, 8])), (262, Short(&[2])), (277, Short(&[3]))];
    image(size, &usual, tags, chunks, false)
}

fn image(
    [width, height]: [u32; 2],
    usual: &[(u16, Values)],
    tags: &[(u16, Values)],
    chunks: &[&[u8]],
    big_endian: bool,
) -> Vec<u8> {
    let (width, height) = ([width], [height]);
    let mut all = vec![(256, Long(&width)), (257, Long(&height))];
    for (tag, values) in usual.iter().chain(tags) {
        all.retain(|(other, _)| other != tag);
        all.push((*tag, *values));
    }
    let tiled = tags.iter().any(|(tag, _)| *tag == 322);
    Tiff { big_endian, tiled, tags: &all, chunks }.bytes()
}

fn known<T, const N: usize>(values: [T; N]) -> [Option<T>; N] {
    values.map(Some)
}

/// GDAL's `INTERLEAVE=BAND, TILED=YES`, for a size that is no multiple of the tile size.
#[test]
fn planes_in_tiles_larger_than_the_image() {
    // 5 x 3 pixels in tiles of 4 x 2: two across, two down, for each of three planes.
    let value = |x: usize, y: usize, c: usize| (100 * c + 10 * y + x) as u8;
    let tile = |i: usize| -> Vec<u8> {
        let (c, top, left) = (i / 4, i / 2 % 2 * 2, i % 2 * 4);
        (0..8).map(|j| value(left + j % 4, top + j / 4, c)).collect()
    };
    let tiles: Vec<_> = (0..12).map(tile).collect();
    let tiles: Vec<&[u8]> = tiles.iter().map(Vec::as_slice).collect();
    let tags = [(284, Short(&[2])), (322, Short(&[4])), (323, Short(&[2]))];
    let expected: Vec<_> =
        (0..15).map(|i| Some([0, 1, 2].map(|c| u16::from(value(i % 5, i / 5, c))))).collect();
    assert_eq!(colours(&rgb([5, 3], &tags, &tiles)), expected);
    // Some programs store the positions of tiles in the tags of strips.
    let size = [(256, Long(&[5])), (257, Long(&[3])), (258, Short(&[8, 8, 8])), (262, Short(&[2]))];
    let tags = [&size[..], &[(277, Short(&[3]))], &tags].concat();
    assert_eq!(
        colours(&Tiff { big_endian: false, tiled: false, tags: &tags, chunks: &tiles }.bytes()),
        expected
    );
    // Planes in strips of two rows.
    let strips: Vec<Vec<u8>> = (0..6)
        .map(|i| {
            let rows = if i % 2 == 0 { 0..2 } else { 2..3 };
            rows.flat_map(|y| (0..5).map(move |x| value(x, y, i / 2))).collect()
        })
        .collect();
    let strips: Vec<&[u8]> = strips.iter().map(Vec::as_slice).collect();
    assert_eq!(colours(&rgb([5, 3], &[(278, Short(&[2])), (284, Short(&[2]))], &strips)), expected);
}

#[test]
fn missing_tiles_hold_no_data() {
    let tags = [(322, Short(&[2])), (323, Short(&[1])), (42_113, Text("7"))];
    assert_eq!(greys(&grey([4, 1], &tags, &[&[], &[5, 6]])), [None, None, Some(5), Some(6)]);
    assert_eq!(greys(&grey([4, 1], &tags[..2], &[&[], &[5, 6]])), known([0, 0, 5, 6]));
}

#[test]
fn bits_in_either_order() {
    let row = [1_u8, 2, 3, 0x50];
    let reversed = row.map(u8::reverse_bits);
    let least_first = (266, Short(&[2]));
    let expected = known([1, 2, 3, 0x50]);
    assert_eq!(greys(&grey([4, 1], &[], &[&row])), expected);
    assert_eq!(greys(&grey([4, 1], &[least_first], &[&reversed])), expected);
    assert_ne!(greys(&grey([4, 1], &[], &[&reversed])), expected, "control");
    // PackBits with four literal bytes; its control bytes are reversed too.
    let packed = [&[3], &row[..]].concat();
    let reversed: Vec<u8> = packed.iter().map(|byte| byte.reverse_bits()).collect();
    assert_eq!(greys(&grey([4, 1], &[(259, Short(&[32_773]))], &[&packed])), expected);
    assert_eq!(greys(&grey([4, 1], &[(259, Short(&[32_773])), least_first], &[&reversed])), expected);
    // Bits inside JPEG data are not reversed.
    let jpeg = jpeg(&[200], None, None);
    let tags = [(259, Short(&[7])), least_first];
    assert_eq!(greys(&grey([8, 8], &tags, &[&jpeg])), [Some(200); 64]);
    refused(&grey([4, 1], &[(266, Short(&[3]))], &[&row]), &["unknown order 3"]);
}

#[test]
fn samples_of_every_depth() {
    let unsigned = |bits: u16, big_endian: bool, row: &[u8], width: u32| {
        left(&image([width, 1], &[(258, Short(&[bits])), (262, Short(&[1]))], &[], &[row], big_endian))
    };
    let levels = |bits, row: &[u8], width| -> Vec<u16> {
        unsigned(bits, false, row, width).pixels.data().iter().map(|pixel| pixel[3]).collect()
    };
    // Up to 8 bits, values are stretched to all 8-bit levels.
    let spread = |values: &[u16]| values.iter().map(|v| v << 8).collect::<Vec<u16>>();
    assert_eq!(levels(1, &[0b0110_0000], 3), spread(&[0, 255, 255]));
    assert_eq!(levels(2, &[0b0001_1011], 4), spread(&[0, 85, 170, 255]));
    assert_eq!(levels(3, &[0b0001_1101, 0b1000_0000], 3), spread(&[0, 255, 109]));
    assert_eq!(levels(4, &[0x08, 0xf0], 3), spread(&[0, 136, 255]));
    assert_eq!(levels(8, &[0, 7, 255], 3), spread(&[0, 7, 255]));
    // Deeper samples are shifted up by the bits that none of them uses.
    assert_eq!(levels(10, &[0xff, 0xc0, 0x10], 2), [1023 << 6, 1 << 6]);
    assert_eq!(levels(12, &[0x12, 0x3f, 0xff], 2), [0x123 << 4, 0xfff << 4]);
    assert_eq!(levels(14, &[0xff, 0xfc, 0x00, 0x10], 2), [0x3fff << 2, 1 << 2]);
    assert_eq!(levels(16, &[0x23, 0x81, 0xff, 0xff], 2), [0x8123, 0xffff]);
    // Wider values are scaled from the smallest to the largest.
    for (bits, row) in [
        (20, &[0, 0, 0, 0, 2, 0, 0, 0x50][..]),
        (24, &[0, 0, 0, 2, 0, 0, 5, 0, 0]),
        (32, &[0, 0, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0]),
        (64, &[0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        assert_eq!(levels(bits, row, 3), [0, 26_112, 65_280], "{bits}");
    }
    // Samples follow the byte order of the file; packed bits have a single order.
    let big = unsigned(16, true, &[0x81, 0x23, 0xff, 0xff], 2);
    assert_eq!(big.pixels.data()[0][3], 0x8123);
    let big = unsigned(12, true, &[0x12, 0x3f, 0xff], 2);
    assert_eq!(big.pixels.data()[0][3], 0x123 << 4);
    let big = unsigned(24, true, &[0, 0, 0, 0, 0, 2, 0, 0, 5], 3);
    assert_eq!(big.pixels.data()[1][3], 26_112);
    // Three samples of 12 bits.
    let tags = [(258, Short(&[12, 12, 12]))];
    let pixel = left(&rgb([1, 1], &tags, &[&[0x12, 0x3f, 0xff, 0x00, 0x10]])).pixels.data()[0];
    assert_eq!(pixel[..3], [0x123 << 4, 0xfff << 4, 1 << 4]);
    for depths in [&[5_u16, 6, 5][..], &[0, 0, 0], &[65, 65, 65]] {
        refused(&rgb([1, 1], &[(258, Short(depths))], &[&[0; 9]]), &["samples"]);
    }
}

#[test]
fn samples_of_every_format() {
    let row = [0, 0, 0xff, 0xff, 0x01, 0x00];
    let formatted = |format: &[u16]| {
        let bytes = grey([3, 1], &[(258, Short(&[16])), (339, Short(format))], &[&row]);
        greys(&bytes)
    };
    assert_eq!(formatted(&[1]), known([0, 255, 0]));
    // -1 is below 0.
    assert_eq!(formatted(&[2]), known([127, 0, 255]));
    // 0, NaN and the smallest number above 0.
    assert_eq!(formatted(&[3]), [Some(0), None, Some(255)]);
    assert_eq!(formatted(&[4]), formatted(&[1]), "undefined");
    for (format, words) in [(5_u16, "complex"), (6, "complex"), (7, "unknown format 7")] {
        let bytes = grey([3, 1], &[(258, Short(&[16])), (339, Short(&[format]))], &[&row]);
        refused(&bytes, &[words]);
    }
    let mixed = rgb([1, 1], &[(339, Short(&[1, 1, 2]))], &[&[1, 2, 3]]);
    refused(&mixed, &["different formats"]);
    refused(&grey([3, 1], &[(258, Short(&[24])), (339, Short(&[3]))], &[&[0; 9]]), &["24 bits"]);
    // Signed samples of 8, 32 and 64 bits, and doubles.
    let signed = |bits: u16, format: u16, values: &[&[u8]]| {
        let row = values.concat();
        greys(&grey([3, 1], &[(258, Short(&[bits])), (339, Short(&[format]))], &[&row]))
    };
    let expected = known([0, 127, 255]);
    assert_eq!(signed(8, 2, &[&[0x80], &[0], &[0x80 - 1]])[0], Some(0));
    assert_eq!(signed(32, 2, &[-9_i32, 0, 9].map(i32::to_le_bytes).each_ref().map(|b| &b[..])), expected);
    assert_eq!(signed(64, 2, &[-9_i64, 0, 9].map(i64::to_le_bytes).each_ref().map(|b| &b[..])), expected);
    assert_eq!(
        signed(64, 3, &[-9.0_f64, 0.0, 9.0].map(f64::to_le_bytes).each_ref().map(|b| &b[..])),
        expected
    );
}

#[test]
fn white_may_be_zero() {
    let white = (262, Short(&[0]));
    assert_eq!(greys(&grey([3, 1], &[white], &[&[0, 7, 255]])), known([255, 248, 0]));
    assert_eq!(greys(&grey([3, 1], &[white, (258, Short(&[1]))], &[&[0b0110_0000]])), known([255, 0, 0]));
    assert_eq!(greys(&grey([3, 1], &[white, (258, Short(&[4]))], &[&[0x08, 0xf0]])), known([255, 119, 0]));
    let row = [0, 0, 0xff, 0xff];
    assert_eq!(greys(&grey([2, 1], &[white, (258, Short(&[16]))], &[&row])), known([255, 0]));
    let row = [0x00, 0x0f, 0xff];
    assert_eq!(greys(&grey([2, 1], &[white, (258, Short(&[12]))], &[&row])), known([255, 0]));
    let row = [-1.0_f32, 1.0].map(f32::to_le_bytes).concat();
    let tags = [white, (258, Short(&[32])), (339, Short(&[3]))];
    assert_eq!(greys(&grey([2, 1], &tags, &[&row])), known([255, 0]));
}

#[test]
fn palettes_of_every_depth() {
    let palette = |bits: u16, shift: u16, row: &[u8], width| {
        let count = 1_usize << bits;
        // Red is the index, green 100 more, blue twice as much, in the upper bytes.
        let map: Vec<u16> = (0..3 * count)
            .map(|i| ((i % count + [0, 100, i % count][i / count]) as u16 & 255) << shift)
            .collect();
        colours(&grey([width, 1], &[(258, Short(&[bits])), (262, Short(&[3])), (320, Short(&map))], &[row]))
    };
    let expected = known([[0, 100, 0], [3, 103, 6], [2, 102, 4]]);
    assert_eq!(palette(2, 8, &[0b0011_1000], 3), expected);
    assert_eq!(palette(4, 8, &[0x03, 0x20], 3), expected);
    assert_eq!(palette(8, 8, &[0, 3, 2], 3), expected);
    assert_eq!(palette(16, 8, &[0, 0, 3, 0, 2, 0], 3), expected);
    assert_eq!(palette(8, 0, &[0, 3, 2], 3), expected, "8 bits in place of 16");
    refused(&grey([3, 1], &[(262, Short(&[3]))], &[&[0, 3, 2]]), &["palette", "missing"]);
    refused(
        &grey([3, 1], &[(262, Short(&[3])), (320, Short(&[9; 300]))], &[&[0, 3, 2]]),
        &["palette", "too short"],
    );
}

#[test]
fn alpha_plain_and_premultiplied() {
    let with = |extra: &[u16], row: &[u8]| {
        let tags = [(258, Short(&[8, 8, 8, 8])), (277, Short(&[4])), (338, Short(extra))];
        let tags = if extra.is_empty() { &tags[..2] } else { &tags[..] };
        colours(&rgb([2, 1], tags, &[row]))
    };
    let row = [10, 20, 100, 128, 1, 2, 3, 0];
    // 1: premultiplied by alpha. 10 / (128 / 255) is 20.
    assert_eq!(with(&[1], &row), [Some([20, 40, 199]), None]);
    assert_eq!(with(&[2], &row), [Some([10, 20, 100]), None]);
    assert_eq!(with(&[], &row), [Some([10, 20, 100]), None], "not said, but meant");
    assert_eq!(with(&[0], &row), known([[10, 20, 100], [1, 2, 3]]), "something else");
    let tags = [(258, Short(&[8, 8])), (277, Short(&[2])), (338, Short(&[2]))];
    assert_eq!(greys(&grey([2, 1], &tags, &[&[255, 1, 9, 0]])), [Some(255), None]);
    // Grey, in planes.
    let tags = [(258, Short(&[8, 8])), (277, Short(&[2])), (284, Short(&[2])), (338, Short(&[1]))];
    assert_eq!(greys(&grey([2, 1], &tags, &[&[10, 9], &[128, 0]])), [Some(20), None]);
    let tags = [(258, Short(&[16; 4])), (277, Short(&[4])), (338, Short(&[1]))];
    let row = [0, 16, 0, 32, 0, 64, 0, 128];
    let pixel = left(&rgb([1, 1], &tags, &[&row])).pixels.data()[0];
    assert_eq!(pixel[..3], [0x1000, 0x2000, 0x4000].map(|v: u32| ((v * 65_535 + 0x4000) / 0x8000) as u16));
    // Files with more samples than these are not pictures.
    let tags = [(258, Short(&[8, 8])), (277, Short(&[2])), (338, Short(&[0]))];
    refused(&grey([2, 1], &tags, &[&[1, 2, 3, 4]]), &["2 bands", "extract one"]);
    let tags = [(258, Short(&[8; 5])), (277, Short(&[5])), (338, Short(&[0, 0]))];
    assert_eq!(colours(&rgb([1, 1], &tags, &[&[1, 2, 3, 4, 5]])), known([[1, 2, 3]]), "further bands");
}

#[test]
fn inks_and_chroma() {
    let tags = [(258, Short(&[8; 4])), (262, Short(&[5])), (277, Short(&[4]))];
    assert_eq!(colours(&rgb([1, 1], &tags, &[&[0, 100, 255, 51]])), known([[204, 124, 0]]));
    let other = [&tags[..], &[(332, Short(&[2]))]].concat();
    refused(&rgb([1, 1], &other, &[&[0; 4]]), &["inks other than"]);

    let ycbcr = |tags: &[(u16, Values)], size, data: &[u8]| {
        colours(&rgb(size, &[&[(262, Short(&[6]))], tags].concat(), &[data]))
    };
    let full = (530, Short(&[1, 1]));
    assert_eq!(ycbcr(&[full], [1, 1], &[120, 148, 98]), known([[78, 135, 155]]));
    // 2 x 2 blocks share their chroma, and the last blocks extend beyond the image.
    let units = [120, 121, 122, 123, 148, 98, 50, 0, 51, 0, 128, 128];
    let found = ycbcr(&[(530, Short(&[2, 2]))], [3, 2], &units);
    assert_eq!(
        found,
        known([[78, 135, 155], [79, 136, 156], [50; 3], [80, 137, 157], [81, 138, 158], [51; 3]])
    );
    assert_eq!(ycbcr(&[], [3, 2], &units), found, "as it is where nothing is said");
    // The reference black is 16 and white 235, as in video.
    let video = Fraction(&[(16, 1), (235, 1), (128, 1), (240, 1), (128, 1), (240, 1)]);
    assert_eq!(
        ycbcr(&[full, (532, video)], [2, 1], &[16, 128, 128, 235, 128, 128]),
        known([[0; 3], [255; 3]])
    );
    let other = Fraction(&[(2126, 10_000), (7152, 10_000), (722, 10_000)]);
    assert_ne!(ycbcr(&[full, (529, other)], [1, 1], &[120, 148, 98]), known([[78, 135, 155]]));
    refused(&rgb([1, 1], &[(262, Short(&[6])), (530, Short(&[3, 1]))], &[&[0; 3]]), &["chroma"]);
    refused(
        &rgb([1, 1], &[(262, Short(&[6])), full, (529, Fraction(&[(1, 0); 3]))], &[&[0; 3]]),
        &["colours that cannot be"],
    );
}

#[test]
fn unsupported_files_are_refused() {
    for (photometric, words) in [
        (4_u16, "mask of another image"),
        (8, "Lab"),
        (9, "Lab"),
        (10, "Lab"),
        (32_803, "raw file"),
        (34_892, "raw file"),
        (32_845, "Luv"),
        (77, "unknown photometric interpretation 77"),
    ] {
        refused(&grey([1, 1], &[(262, Short(&[photometric]))], &[&[0]]), &[words]);
    }
    for (compression, words) in [
        (2_u16, "compression 2 (fax)"),
        (6, "compression 6 (JPEG)"),
        (34_925, "LZMA"),
        (50_000, "Zstandard"),
        (50_001, "WebP"),
        (99, "compression 99,"),
    ] {
        refused(&grey([1, 1], &[(259, Short(&[compression]))], &[&[0]]), &[words, "convert it to PNG"]);
    }
    refused(&grey([1, 1], &[(284, Short(&[3]))], &[&[0]]), &["unknown configuration 3"]);
    refused(&grey([3, 1], &[(259, Short(&[5])), (317, Short(&[3]))], &[&[0]]), &["predictor 3"]);
    refused(&grey([3, 1], &[(317, Short(&[2]))], &[&[1, 2, 3]]), &["predictor", "not packed by LZW"]);
}

#[test]
fn the_first_full_size_image_is_read() {
    // Two directories, assembled by hand: the one of a second file follows the first.
    let chain = |kind: u32| {
        let mut first = grey([1, 1], &[(254, Long(&[kind]))], &[&[9]]);
        let second = grey([2, 1], &[], &[&[5, 6]]);
        let base = first.len() as u32;
        let end = first.len();
        first[end - 4..]
            .copy_from_slice(&(base + u32::from_le_bytes(second[4..8].try_into().unwrap())).to_le_bytes());
        // The position of its strip, from the start of the first file.
        let mut second = second;
        let place = second.windows(2).rposition(|tag| tag == 273_u16.to_le_bytes()).unwrap();
        second[place + 8..place + 12].copy_from_slice(&(base + 8).to_le_bytes());
        first.extend(second);
        first
    };
    assert_eq!(greys(&chain(0)), known([9]));
    assert_eq!(greys(&chain(1)), known([5, 6]), "a reduced copy comes first");
    assert_eq!(greys(&chain(4)), known([5, 6]), "a mask comes first");
    assert_eq!(greys(&grey([1, 1], &[(254, Long(&[1]))], &[&[9]])), known([9]), "there is but one");
    let below = [(254, Long(&[1][..])), (330, Long(&[8]))];
    refused(&grey([1, 1], &below, &[&[9]]), &["reduced copy", "directory below"]);
}

/// GDAL's tag, with every kind of sample.
#[test]
fn no_data_pixels_are_masked() {
    let masked = |bits: u16, format: u16, text: &str, values: &[&[u8]]| {
        let tags = [(258, Short(&[bits])), (339, Short(&[format])), (42_113, Text(text))];
        let row = values.concat();
        let image = left(&grey([values.len() as u32, 1], &tags, &[&row]));
        image.masked.data().to_vec()
    };
    assert_eq!(masked(8, 1, "255", &[&[0], &[255], &[7]]), [false, true, false]);
    assert_eq!(masked(8, 1, "256", &[&[0], &[255], &[7]]), [false; 3]);
    assert_eq!(masked(8, 2, "-1", &[&[0], &[255], &[7]]), [false, true, false]);
    let words = [0_u16, 65_535, 9].map(u16::to_le_bytes);
    let words = words.each_ref().map(|b| &b[..]);
    assert_eq!(masked(16, 1, " 65535 ", &words), [false, true, false]);
    assert_eq!(masked(16, 2, "-1", &words), [false, true, false]);
    let long = [-9999_i32, 5].map(i32::to_le_bytes);
    assert_eq!(masked(32, 2, "-9999", &long.each_ref().map(|b| &b[..])), [true, false]);
    for text in ["-3.40282346638529e+38", "-3.4028235e+38", "-3.4028234663852886e+38"] {
        let values = [f32::MIN, 5.0, 6.0].map(f32::to_le_bytes);
        assert_eq!(masked(32, 3, text, &values.each_ref().map(|b| &b[..])), [true, false, false], "{text}");
    }
    let double = [-1.797_693_134_862_315_7e308_f64, 5.0].map(f64::to_le_bytes);
    assert_eq!(masked(64, 3, "-1.7976931348623157e+308", &double.each_ref().map(|b| &b[..])), [true, false]);
    let float = [f32::NAN, 5.0].map(f32::to_le_bytes);
    assert_eq!(masked(32, 3, "nan", &float.each_ref().map(|b| &b[..])), [true, false]);
    // Masked values do not affect the levels of the others.
    let values = [f32::MIN, 5.0, 6.0].map(f32::to_le_bytes).concat();
    let tags = [(258, Short(&[32])), (339, Short(&[3])), (42_113, Text("-3.4028235e+38"))];
    assert_eq!(greys(&grey([3, 1], &tags, &[&values])), [None, Some(0), Some(255)]);
    assert_eq!(greys(&grey([3, 1], &tags[..2], &[&values])), known([0, 255, 255]), "control");
    // All colour samples must match. A palette matches by index, an inverted image by its stored value.
    let tag = (42_113, Text("3"));
    assert_eq!(colours(&rgb([2, 1], &[tag], &[&[3, 3, 3, 3, 3, 4]])), [None, Some([3, 3, 4])]);
    assert_eq!(greys(&grey([2, 1], &[(262, Short(&[0])), tag], &[&[3, 252]])), [None, Some(3)]);
    refused(&grey([1, 1], &[(42_113, Text("none"))], &[&[1]]), &["no-data value `none`", "not a number"]);
}

#[test]
fn the_caller_can_set_the_no_data_value() {
    let (_folder, path) = file(&grey([3, 1], &[(42_113, Text("7"))], &[&[0, 7, 255]]));
    let masked = |no_data| {
        let reader = Reader { no_data, ..Reader::default() };
        reader.pair(&path, &path, None).unwrap().right().masked.data().to_vec()
    };
    assert_eq!(masked(None), [false, true, false]);
    assert_eq!(masked(Some(255.0)), [false, false, true]);
    // Other formats use the value as well.
    let (_folder, path) = file(b"P5\n3 1\n255\n\x00\x07\xff");
    let reader = Reader { no_data: Some(0.0), ..Reader::default() };
    assert_eq!(reader.pair(&path, &path, None).unwrap().left().masked.data(), [true, false, false]);
}

#[test]
fn disparity_maps_have_holes() {
    let values = [-9999.0_f32, 5.0, 6.0].map(f32::to_le_bytes).concat();
    let tags = [(258, Short(&[32])), (339, Short(&[3])), (42_113, Text("-9999"))];
    let (_folder, path) = file(&grey([3, 1], &tags, &[&values]));
    assert_eq!(read::read_disparity(&path).unwrap().data(), [f32::INFINITY, 5.0, 6.0]);
}
