use std::fs;
use std::io::{Cursor, Write};
use std::path::PathBuf;

use image::{GrayImage, ImageFormat, Luma};
use tempfile::TempDir;
use tiff::encoder::compression::{CompressionAlgorithm, Deflate, Lzw, Packbits};

use super::*;
use crate::image::{Plane, pfm};

/// Numbers that only look random.
struct Random(u32);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 as usize % n
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.below(256) as u8).collect()
    }

    fn part(&mut self, (width, height): (usize, usize)) -> Rect {
        let mut range = |n: usize| {
            let start = self.below(n);
            start..start + 1 + self.below(n - start)
        };
        Rect { x: range(width), y: range(height) }
    }
}

/// A folder for the files of one test.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn bytes(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// A tag, the type of its values, the bytes of each, and the values.
type Tag = (u16, (u16, usize, Vec<usize>));

/// A TIFF file whose samples are random.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "tags of files")]
struct Sketch {
    size: (usize, usize),
    samples: usize,
    bits: usize,
    /// 1 unsigned, 2 signed, 3 float.
    format: usize,
    photometric: usize,
    /// The kind of an extra sample.
    extra: Option<usize>,
    planar: bool,
    /// Of a tile, or all columns and the rows of a strip.
    chunk: (usize, usize),
    tiled: bool,
    compression: usize,
    predictor: usize,
    reversed: bool,
    highest_first: bool,
    big: bool,
    subsampling: Option<(usize, usize)>,
    no_data: Option<&'static str>,
    orientation: usize,
    is_on_the_ground: bool,
    /// Every so many tiles, one is omitted.
    omitted: Option<usize>,
}

const NONE: usize = 1;
const LZW: usize = 5;
const JPEG: usize = 7;
const DEFLATE: usize = 8;
const PACK_BITS: usize = 32_773;

impl Sketch {
    fn plain(size: (usize, usize)) -> Self {
        Self {
            size,
            samples: 1,
            bits: 8,
            format: 1,
            photometric: 1,
            extra: None,
            planar: false,
            chunk: size,
            tiled: false,
            compression: NONE,
            predictor: 1,
            reversed: false,
            highest_first: false,
            big: false,
            subsampling: None,
            no_data: None,
            orientation: 1,
            is_on_the_ground: false,
            omitted: None,
        }
    }

    fn random(r: &mut Random, size: (usize, usize)) -> Self {
        // Samples, bits, format, photometric interpretation, kind of the extra sample.
        let (samples, bits, format, photometric, extra) = r.one_of(&[
            (1, 8, 1, 1, None),
            (1, 8, 1, 0, None),
            (1, 1, 1, 0, None),
            (1, 4, 1, 1, None),
            (1, 12, 1, 1, None),
            (3, 12, 1, 2, None),
            (1, 16, 1, 1, None),
            (1, 16, 2, 1, None),
            (1, 32, 1, 1, None),
            (1, 16, 3, 1, None),
            (1, 32, 3, 1, None),
            (1, 64, 3, 1, None),
            (2, 8, 1, 1, Some(2)),
            (2, 16, 1, 1, Some(1)),
            (3, 8, 1, 2, None),
            (3, 16, 1, 2, None),
            (3, 32, 3, 2, None),
            (4, 8, 1, 2, None),
            (4, 8, 1, 2, Some(1)),
            (4, 16, 1, 2, Some(2)),
            (5, 8, 1, 2, Some(0)),
            (4, 8, 1, 5, None),
            (4, 16, 1, 5, None),
            (1, 8, 1, 3, None),
            (1, 4, 1, 3, None),
            (2, 8, 1, 3, Some(2)),
            (3, 8, 1, 6, None),
        ]);
        let mut compression = r.one_of(&[NONE, NONE, LZW, DEFLATE, DEFLATE, PACK_BITS, JPEG]);
        let planar = samples > 1 && photometric != 6 && r.below(3) == 0;
        if compression == JPEG && (bits != 8 || photometric != 1 || samples != 1) {
            compression = DEFLATE;
        }
        let mut predictor = 1;
        if matches!(compression, LZW | DEFLATE) && photometric != 6 && matches!(bits, 8 | 16 | 32 | 64) {
            predictor = r.one_of(if format == 3 { &[1, 2, 3] } else { &[1, 2] });
        }
        let tiled = r.below(2) == 0;
        let subsampling = (photometric == 6).then(|| r.one_of(&[(1, 1), (2, 2), (2, 1), (4, 2), (1, 2)]));
        let mut chunk = if tiled { (16 + 16 * r.below(2), 16) } else { (size.0, 1 + r.below(size.1 + 3)) };
        if let Some((_, down)) = subsampling {
            chunk.1 = chunk.1.next_multiple_of(down);
        }
        Self {
            size,
            samples,
            bits,
            format,
            photometric,
            extra,
            planar,
            chunk,
            tiled,
            compression,
            predictor,
            reversed: compression != JPEG && r.below(4) == 0,
            highest_first: r.below(3) == 0,
            big: r.below(4) == 0,
            subsampling,
            no_data: r.one_of(&[None, None, Some("0"), Some("7"), Some("255")]),
            orientation: r.one_of(&[1, 1, 2, 3, 4, 5, 6, 7, 8]),
            is_on_the_ground: r.below(3) == 0,
            omitted: (tiled && compression != NONE && r.below(2) == 0).then_some(3),
        }
    }

    /// The rows of a strip or tile, packed.
    fn packed(&self, r: &mut Random, rows: usize) -> Vec<u8> {
        let (width, samples) = (self.chunk.0, if self.planar { 1 } else { self.samples });
        if self.compression == JPEG {
            let image = GrayImage::from_fn(width as u32, rows as u32, |_, _| Luma([r.below(256) as u8]));
            let mut file = Cursor::new(Vec::new());
            image.write_to(&mut file, ImageFormat::Jpeg).unwrap();
            return file.into_inner();
        }
        let count = match self.subsampling.filter(|sub| *sub != (1, 1)) {
            Some((across, down)) => width.div_ceil(across) * (across * down + 2) * rows.div_ceil(down),
            None => (width * samples * self.bits).div_ceil(8) * rows,
        };
        let bytes = if self.format == 3 && self.predictor == 1 {
            // Random bits of floats are often as large as can be.
            let value = |r: &mut Random| (r.below(1000) as f32 / 8.0 - 40.0, r.below(20) == 0);
            let values = (0..count * 8 / self.bits).flat_map(|_| {
                let (value, wild) = value(r);
                let value = if wild { f32::NAN } else { value };
                let mut bytes = match self.bits {
                    16 => half::f16::from_f32(value).to_le_bytes().to_vec(),
                    32 => value.to_le_bytes().to_vec(),
                    _ => f64::from(value).to_le_bytes().to_vec(),
                };
                if self.highest_first {
                    bytes.reverse();
                }
                bytes
            });
            values.collect()
        } else if self.bits == 16 && r.below(2) == 0 {
            let values = (0..count / 2).map(|_| r.below(4096) as u16);
            let order = if self.highest_first { u16::to_be_bytes } else { u16::to_le_bytes };
            values.flat_map(order).collect()
        } else {
            r.bytes(count)
        };
        let mut out = Vec::new();
        match self.compression {
            LZW => _ = Lzw.write_to(&mut out, &bytes).unwrap(),
            DEFLATE => _ = Deflate::default().write_to(&mut out, &bytes).unwrap(),
            PACK_BITS => _ = Packbits.write_to(&mut out, &bytes).unwrap(),
            _ => out = bytes,
        }
        if self.reversed {
            for byte in &mut out {
                *byte = byte.reverse_bits();
            }
        }
        out
    }

    /// The file, with the directory before the pixels.
    fn file(&self, r: &mut Random) -> Vec<u8> {
        let (across, down) = (self.size.0.div_ceil(self.chunk.0), self.size.1.div_ceil(self.chunk.1));
        let planes = if self.planar { self.samples } else { 1 };
        let mut chunks = Vec::new();
        for i in 0..across * down * planes {
            let top = i / across % down * self.chunk.1;
            let rows = if self.tiled { self.chunk.1 } else { self.chunk.1.min(self.size.1 - top) };
            let omitted = self.omitted.is_some_and(|every| i % every == 1);
            chunks.push(if omitted { Vec::new() } else { self.packed(r, rows) });
        }
        let short = |values: &[usize]| (3_u16, 2, values.to_vec());
        let long = |values: &[usize]| (4_u16, 4, values.to_vec());
        // Tag, type, bytes of each value, values.
        let mut tags = vec![
            (256_u16, long(&[self.size.0])),
            (257, long(&[self.size.1])),
            (258, short(&vec![self.bits; self.samples])),
            (259, short(&[self.compression])),
            (262, short(&[self.photometric])),
            (266, short(&[if self.reversed { 2 } else { 1 }])),
            (274, short(&[self.orientation])),
            (277, short(&[self.samples])),
            (284, short(&[if self.planar { 2 } else { 1 }])),
            (317, short(&[self.predictor])),
            (339, short(&vec![self.format; self.samples])),
        ];
        tags.extend(self.extra.map(|extra| (338, short(&[extra]))));
        tags.extend(self.subsampling.map(|(across, down)| (530, short(&[across, down]))));
        tags.extend(self.no_data.map(|value| {
            (42_113, (2_u16, 1, value.bytes().chain([0]).map(usize::from).collect::<Vec<_>>()))
        }));
        if self.photometric == 3 {
            let map: Vec<usize> = (0..3 << self.bits).map(|_| r.below(65_536)).collect();
            tags.push((320, short(&map)));
        }
        if self.is_on_the_ground {
            let double =
                |values: &[f64]| (12_u16, 8, values.iter().map(|v| v.to_bits() as usize).collect::<Vec<_>>());
            tags.push((33_550, double(&[0.5, 0.5, 0.0])));
            tags.push((33_922, double(&[0.0, 0.0, 0.0, 4e5, 6e6, 0.0])));
            tags.push((34_735, short(&[1, 1, 0, 1, 1024, 0, 1, 1])));
        }
        let (offsets, counts) = if self.tiled { (324, 325) } else { (273, 279) };
        if self.tiled {
            tags.push((322, long(&[self.chunk.0])));
            tags.push((323, long(&[self.chunk.1])));
        } else {
            tags.push((278, long(&[self.chunk.1])));
        }
        tags.push((counts, long(&chunks.iter().map(Vec::len).collect::<Vec<_>>())));
        // The offsets are known once the length of the directory is.
        let with = |start: usize| {
            let places = chunks.iter().scan(start, |at, chunk| {
                *at += chunk.len();
                Some(*at - chunk.len())
            });
            let places: Vec<usize> = places.collect();
            let mut all = tags.clone();
            all.push((offsets, long(&places)));
            all.sort_by_key(|tag| tag.0);
            self.directory(&all)
        };
        let directory = with(with(0).len());
        [&[directory], &chunks[..]].concat().concat()
    }

    fn directory(&self, tags: &[Tag]) -> Vec<u8> {
        let number = |value: usize, bytes: usize| {
            let mut all = (value as u64).to_le_bytes()[..bytes].to_vec();
            if self.highest_first {
                all.reverse();
            }
            all
        };
        let wide = if self.big { 8 } else { 4 };
        let mut out = if self.highest_first { b"MM".to_vec() } else { b"II".to_vec() };
        out.extend(number(if self.big { 43 } else { 42 }, 2));
        if self.big {
            out.extend([number(8, 2), number(0, 2), number(16, 8), number(tags.len(), 8)].concat());
        } else {
            out.extend([number(8, 4), number(tags.len(), 2)].concat());
        }
        let mut place = out.len() + tags.len() * (4 + 2 * wide) + wide;
        let mut behind = Vec::new();
        for (tag, (kind, size, values)) in tags {
            out.extend(
                [number((*tag).into(), 2), number((*kind).into(), 2), number(values.len(), wide)].concat(),
            );
            let mut bytes: Vec<u8> = values.iter().flat_map(|value| number(*value, *size)).collect();
            if bytes.len() <= wide {
                bytes.resize(wide, 0);
                out.extend(bytes);
            } else {
                out.extend(number(place, wide));
                place += bytes.len();
                behind.extend(bytes);
            }
        }
        out.extend(number(0, wide));
        out.extend(behind);
        out
    }
}

/// Compares windows of a pair with parts of the whole one, with all of it in scratch files, with a part in memory, and with
/// everything in memory.
fn compare(r: &mut Random, reader: Reader, [left, right]: [&Path; 2], mask: Option<&Path>, what: &str) {
    let scratch = tempfile::tempdir().unwrap();
    let pair = reader.pair(left, right, mask).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(reader.size(left).unwrap(), pair.size(), "{what}");
    for kept in [0, 900, KEPT] {
        let windows = reader.windows_keeping(kept, [left, right], mask, scratch.path());
        let windows = windows.unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!(windows.size(), pair.size(), "{what}");
        assert_eq!(windows.georeferences(), pair.georeferences(), "{what}");
        assert_eq!(windows.orientations(), pair.orientations(), "{what}");
        assert_eq!(windows.doubts(), pair.doubts(), "{what}");
        let whole = Rect::whole(pair.size());
        for part in [whole, r.part(pair.size()), r.part(pair.size()), r.part(pair.size())] {
            let window = windows.window(&part).unwrap_or_else(|e| panic!("{what}: {e}"));
            assert_eq!(window, pair.crop(&part), "{what}: {part:?}, {kept}");
        }
    }
    // Scratch files have no name.
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0);
}

#[test]
fn windows_of_tiff_files_are_parts_of_the_pair() {
    let (f, mut r) = (Folder::new(), Random(7));
    let (mut turned, mut masked) = (0, 0);
    for i in 0..400 {
        let size = (1 + r.below(50), 1 + r.below(50));
        let left = Sketch::random(&mut r, size);
        // The right image may be packed in another way.
        let right = Sketch {
            compression: r.one_of(&[NONE, DEFLATE]),
            predictor: 1,
            omitted: None,
            orientation: left.orientation,
            no_data: r.one_of(&[None, Some("3")]),
            reversed: false,
            ..left
        };
        let [l, m] = [left, right].map(|sketch| sketch.file(&mut r));
        let files = [f.bytes("l.tif", &l), f.bytes("r.tif", &m)];
        let orient = r.below(2) == 0;
        let no_data = r.one_of(&[None, None, Some(5.0)]);
        let reader = Reader { no_data, orient, ..Reader::default() };
        let sideways = orient && left.orientation > 4;
        let mask = (r.below(3) == 0).then(|| {
            let size = if sideways { (size.1, size.0) } else { size };
            let mask = Sketch { chunk: (16, 16), tiled: true, bits: 1, ..Sketch::plain(size) };
            f.bytes("mask.tif", &mask.file(&mut r))
        });
        turned += usize::from(orient && left.orientation > 1);
        masked += usize::from(mask.is_some());
        let what = format!("{i}: {left:?}, {right:?}, {reader:?}");
        compare(&mut r, reader, [&files[0], &files[1]], mask.as_deref(), &what);
    }
    assert!(turned > 50 && masked > 50, "{turned}, {masked}");
}

/// Levels of words depend on the largest value of both images, which may be far from the window.
#[test]
fn levels_are_those_of_the_whole_pair() {
    let (f, mut r) = (Folder::new(), Random(3));
    let mut values = vec![3_u16; 64 * 48];
    let file = |values: &[u16]| {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
        let mut image = encoder.new_image::<tiff::encoder::colortype::Gray16>(64, 48).unwrap();
        image.rows_per_strip(5).unwrap();
        image.write_data(values).unwrap();
        bytes.into_inner()
    };
    let dark = f.bytes("dark.tif", &file(&values));
    values[64 * 47 + 63] = 1000;
    let bright = f.bytes("bright.tif", &file(&values));
    let level = |left: &Path, right: &Path, mask: Option<&Path>| {
        let windows = Reader::default().windows(left, right, mask, f.path()).unwrap();
        windows.window(&Rect { x: 0..1, y: 0..1 }).unwrap().left().pixels[(0, 0)][0]
    };
    assert_eq!([level(&dark, &dark, None), level(&dark, &bright, None)], [3 << 8, 3 << 6]);
    // A masked value counts nowhere.
    let mask = f.path().join("mask.png");
    GrayImage::from_fn(64, 48, |x, y| Luma([u8::from((x, y) == (63, 47))])).save(&mask).unwrap();
    assert_eq!(level(&bright, &dark, Some(&mask)), 3 << 8);
    let byte = f.path().join("byte.png");
    GrayImage::from_fn(64, 48, |x, y| Luma([(x + y) as u8])).save(&byte).unwrap();
    compare(&mut r, Reader::default(), [&byte, &bright], Some(&mask), "8 bits and 16");
}

/// Several threads may read windows of one pair.
#[test]
fn threads_share_a_pair() {
    let (f, mut r) = (Folder::new(), Random(23));
    let sketch = Sketch {
        tiled: true,
        chunk: (16, 16),
        compression: LZW,
        samples: 3,
        photometric: 2,
        ..Sketch::plain((70, 50))
    };
    let path = f.bytes("a.tif", &sketch.file(&mut r));
    let pair = Pair::open(&path, &path).unwrap();
    let windows = Reader::default().windows_keeping(4000, [&path, &path], None, f.path()).unwrap();
    let parts: Vec<Rect> = (0..40).map(|_| r.part(pair.size())).collect();
    std::thread::scope(|scope| {
        for parts in parts.chunks(10) {
            let (windows, pair) = (&windows, &pair);
            scope.spawn(move || {
                for part in parts {
                    assert_eq!(windows.window(part).unwrap(), pair.crop(part));
                }
            });
        }
    });
}

/// A JPEG file whose EXIF data say this orientation.
fn jpeg(r: &mut Random, size: (u32, u32), orientation: u8) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let image =
        image::RgbImage::from_fn(size.0, size.1, |_, _| image::Rgb([(); 3].map(|()| r.below(256) as u8)));
    image.write_to(&mut file, ImageFormat::Jpeg).unwrap();
    let mut bytes = file.into_inner();
    let exif =
        [&b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..], &[orientation], b"\0\0\0\0\0\0"]
            .concat();
    let length = (exif.len() as u16 + 2).to_be_bytes();
    bytes.splice(2..2, [&[0xff, 0xe1], &length[..], &exif].concat());
    bytes
}

#[test]
fn windows_of_other_files_are_parts_of_the_pair() {
    use image::DynamicImage;
    let (f, mut r) = (Folder::new(), Random(11));
    let (width, height) = (37, 23);
    let mut files = Vec::new();
    for (name, channels) in
        [("a.png", 1), ("b.png", 3), ("c.png", 4), ("d.ppm", 3), ("e.pgm", 1), ("f.bmp", 3)]
    {
        for wide in [false, true] {
            if wide && name.ends_with("bmp") {
                continue;
            }
            let pair = [0, 1].map(|i| {
                let count = (width * height) as usize * channels;
                let bytes: Vec<u8> = (0..count).map(|_| r.below(9) as u8 * 31).collect();
                let words: Vec<u16> = (0..count).map(|_| r.below(1024) as u16).collect();
                let image: DynamicImage = match (channels, wide) {
                    (1, false) => GrayImage::from_raw(width, height, bytes).unwrap().into(),
                    (3, false) => image::RgbImage::from_raw(width, height, bytes).unwrap().into(),
                    (_, false) => image::RgbaImage::from_raw(width, height, bytes).unwrap().into(),
                    (1, true) => {
                        image::ImageBuffer::<Luma<u16>, _>::from_raw(width, height, words).unwrap().into()
                    }
                    (3, true) => image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(width, height, words)
                        .unwrap()
                        .into(),
                    (_, true) => image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(width, height, words)
                        .unwrap()
                        .into(),
                };
                let path = f.path().join(format!("{wide}{i}{name}"));
                image.save(&path).unwrap();
                path
            });
            files.push(pair);
        }
    }
    for orientation in [1, 2, 3, 6, 8] {
        files.push([0, 1].map(|i| {
            let bytes = jpeg(&mut r, (width, height), orientation);
            f.bytes(&format!("{orientation}{i}.jpg"), &bytes)
        }));
    }
    files.push([0, 1].map(|i| {
        let path = f.path().join(format!("{i}.pfm"));
        let value = |x: usize, y: usize| if (x + y) % 11 == i { f32::NAN } else { (x * y + i) as f32 - 4.5 };
        pfm::write(&path, &Plane::from_fn(width as usize, height as usize, value)).unwrap();
        path
    }));
    files.push([0, 1].map(|i| {
        let header = format!("{{'descr': '<u2', 'fortran_order': True, 'shape': ({height}, {width}), }}");
        let values: Vec<u8> =
            (0..width * height).flat_map(|_| (r.below(3000) as u16).to_le_bytes()).collect();
        let length = (header.len() as u16).to_le_bytes();
        f.bytes(&format!("{i}.npy"), &[b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &values].concat())
    }));
    let mask = f.path().join("mask.png");
    GrayImage::from_fn(width, height, |_, _| Luma([r.below(3) as u8 / 2])).save(&mask).unwrap();
    for [left, right] in &files {
        for (orient, no_data, mask) in
            [(false, None, None), (false, Some(31.0), Some(&*mask)), (true, None, None)]
        {
            let reader = Reader { no_data, orient, ..Reader::default() };
            let what = format!("{}, {reader:?}", left.display());
            compare(&mut r, reader, [left, right], mask, &what);
        }
    }
}

/// A PNG file with samples of any number of bits, and all of its chunks.
fn png(r: &mut Random, (width, height): (u32, u32), colour: png::ColorType, depth: png::BitDepth) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if colour == png::ColorType::Indexed {
        encoder.set_palette(r.bytes(3 * 256));
        encoder.set_trns(vec![9, 0, 255, 0]);
    } else if colour == png::ColorType::Grayscale {
        encoder.set_trns(vec![0, 1]);
    }
    let row = (width as usize * colour.samples() * depth as usize).div_ceil(8);
    let data = r.bytes(row * height as usize);
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

/// A grey PNG file of 8 bits with interlaced rows.
fn interlaced(r: &mut Random, (width, height): (usize, usize)) -> Vec<u8> {
    let mut rows = Vec::new();
    for (x, y, dx, dy) in
        [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    {
        let columns = (x..width).step_by(dx).count();
        for _ in (y..height).step_by(dy).filter(|_| columns > 0) {
            rows.push(0);
            rows.extend(r.bytes(columns));
        }
    }
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&rows).unwrap();
    let size = [width, height].map(|n| (n as u32).to_be_bytes()).concat();
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, body) in [
        (b"IHDR", [&size[..], &[8, 0, 0, 0, 1]].concat()),
        (b"IDAT", packed.finish().unwrap()),
        (b"IEND", Vec::new()),
    ] {
        let chunk = [&name[..], &body].concat();
        let mut crc = flate2::Crc::new();
        crc.update(&chunk);
        file.extend([&(body.len() as u32).to_be_bytes()[..], &chunk, &crc.sum().to_be_bytes()].concat());
    }
    file
}

#[test]
fn windows_of_png_files_are_parts_of_the_pair() {
    use png::BitDepth::{Eight, Four, One, Sixteen, Two};
    use png::ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
    let (f, mut r) = (Folder::new(), Random(19));
    let size = (41, 29);
    for (colour, depth) in [
        (Grayscale, One),
        (Grayscale, Two),
        (Grayscale, Four),
        (Grayscale, Eight),
        (Grayscale, Sixteen),
        (GrayscaleAlpha, Eight),
        (GrayscaleAlpha, Sixteen),
        (Indexed, One),
        (Indexed, Four),
        (Indexed, Eight),
        (Rgb, Eight),
        (Rgb, Sixteen),
        (Rgba, Eight),
        (Rgba, Sixteen),
    ] {
        let files = ["l.png", "r.png"].map(|name| f.bytes(name, &png(&mut r, size, colour, depth)));
        for no_data in [None, Some(85.0)] {
            let reader = Reader { no_data, ..Reader::default() };
            compare(&mut r, reader, [&files[0], &files[1]], None, &format!("{colour:?}, {depth:?}"));
        }
    }
    let files = ["l.png", "r.png"].map(|name| f.bytes(name, &interlaced(&mut r, (41, 29))));
    compare(&mut r, Reader::default(), [&files[0], &files[1]], None, "interlaced");
    // A damaged file has the error of the general decoder.
    let sound = png(&mut r, (41, 29), Rgb, Eight);
    for at in (1..sound.len()).step_by(31) {
        let mut flipped = sound.clone();
        flipped[at] ^= 0x10;
        for bytes in [&sound[..at], &flipped] {
            let path = f.bytes("damaged.png", bytes);
            let opened = Reader::default().windows_keeping(0, [&path, &path], None, f.path());
            match Reader::default().pair(&path, &path, None) {
                Ok(pair) => {
                    let whole = Rect::whole(pair.size());
                    assert_eq!(opened.unwrap().window(&whole).unwrap(), pair.crop(&whole));
                }
                Err(error) => assert_eq!(opened.unwrap_err(), error),
            }
        }
    }
}

#[test]
fn errors_are_those_of_whole_pairs() {
    let (f, mut r) = (Folder::new(), Random(5));
    let mut sketch = |name: &str, sketch: Sketch| f.bytes(name, &sketch.file(&mut r));
    let plain = Sketch::plain((40, 30));
    let good = sketch("good.tif", plain);
    let small = sketch("small.tif", Sketch::plain((40, 29)));
    let float = sketch("float.tif", Sketch { format: 3, bits: 32, ..plain });
    let lab = sketch("lab.tif", Sketch { photometric: 8, samples: 3, ..plain });
    let undefined = sketch("undefined.tif", Sketch { no_data: Some("none"), ..plain });
    let (empty, text) = (f.bytes("empty.tif", b""), f.bytes("text.png", b"no image at all"));
    let lie = f.bytes("lie.pgm", b"P5\n16384 16384\n255\n");
    let missing = f.path().join("missing.tif");
    let reader = Reader::default();
    let same = |reader: Reader, left: &Path, right: &Path, mask: Option<&Path>| {
        let whole = reader.pair(left, right, mask).unwrap_err();
        let error = reader.windows(left, right, mask, f.path()).unwrap_err();
        assert_eq!(error, whole);
        assert!(!error.to_string().contains('\n'), "{error}");
    };
    for bad in [&small, &float, &lab, &undefined, &empty, &text, &lie, &missing, f.path()] {
        same(reader, &good, bad, None);
        same(reader, bad, &good, None);
        if *bad != *float {
            same(reader, &good, &good, Some(bad));
        }
        if ![&small, &float, &undefined].iter().any(|sound| **sound == *bad) {
            assert_eq!(reader.size(bad).unwrap_err(), reader.raster(bad).unwrap_err());
        }
    }
    let strict = Reader { max_pixels: 1199, ..reader };
    same(strict, &good, &good, None);
    assert_eq!(strict.size(&good).unwrap_err(), strict.raster(&good).unwrap_err());
    // Without a folder for scratch files, the error has its name.
    let none = f.path().join("none");
    let said = reader.windows_keeping(0, [&jpeg_file(&f), &good], None, &none).unwrap_err().to_string();
    assert!(
        said.starts_with(&format!("cannot write {}: ", none.display())) && !said.contains('\n'),
        "{said}"
    );
    // Parts that leave the image.
    let windows = reader.windows(&good, &good, None, f.path()).unwrap();
    for part in [Rect { x: 0..0, y: 0..1 }, Rect { x: 0..41, y: 0..1 }, Rect { x: 0..1, y: 30..31 }] {
        assert!(matches!(windows.window(&part), Err(Error::Mismatch(_))), "{part:?}");
    }
}

fn jpeg_file(f: &Folder) -> PathBuf {
    f.bytes("a.jpg", &jpeg(&mut Random(1), (40, 30), 1))
}

/// Truncated files are found when they are opened, by the same error.
#[test]
fn truncated_files_are_found() {
    let (f, mut r) = (Folder::new(), Random(9));
    let plain = Sketch::plain((40, 30));
    let tiles = Sketch { tiled: true, chunk: (16, 16), ..plain };
    for sketch in [
        plain,
        Sketch { chunk: (40, 7), compression: LZW, ..plain },
        Sketch { compression: DEFLATE, ..tiles },
        Sketch { planar: true, samples: 3, photometric: 2, big: true, ..tiles },
        Sketch { samples: 3, photometric: 6, subsampling: Some((2, 2)), ..plain },
    ] {
        let whole = sketch.file(&mut r);
        for length in (1..whole.len()).step_by(13) {
            let path = f.bytes("cut.tif", &whole[..length]);
            let opened = Reader::default().windows(&path, &path, None, f.path());
            let expected = Reader::default().pair(&path, &path, None).unwrap_err();
            assert_eq!(opened.unwrap_err(), expected, "{length}: {sketch:?}");
        }
    }
}

/// Damage in one tile is an error of the windows with this tile alone.
#[test]
fn damage_stays_in_its_tile() {
    let (f, mut r) = (Folder::new(), Random(13));
    let sketch = Sketch { tiled: true, chunk: (16, 16), compression: DEFLATE, ..Sketch::plain((64, 48)) };
    let mut bytes = sketch.file(&mut r);
    let at = bytes.len() - 100;
    bytes[at..].fill(0xff);
    let path = f.bytes("damaged.tif", &bytes);
    let windows = Reader::default().windows(&path, &path, None, f.path()).unwrap();
    windows.window(&Rect { x: 0..48, y: 0..48 }).unwrap();
    windows.window(&Rect { x: 0..64, y: 0..32 }).unwrap();
    let error = windows.window(&Rect { x: 60..64, y: 40..48 }).unwrap_err();
    assert_eq!(error, Reader::default().pair(&path, &path, None).unwrap_err());
}

/// The pieces of an image cover it, and no strip or tile is in two of them.
#[test]
fn pieces_keep_strips_and_tiles_whole() {
    let mut r = Random(17);
    for _ in 0..200 {
        let size = (1 + r.below(90), 1 + r.below(90));
        let sketch = Sketch::random(&mut r, size);
        let file = sketch.file(&mut r);
        let image = crate::image::tiff::Stored::find(crate::image::bytes::Bytes::Held(&file), 1 << 20, None);
        let pieces = image.unwrap().pieces(r.one_of(&[1, 100, 1000, 100_000]));
        let mut seen = Plane::filled(size.0, size.1, 0);
        for piece in &pieces {
            for y in piece.y.clone() {
                seen.row_mut(y)[piece.x.clone()].iter_mut().for_each(|count| *count += 1);
            }
            if sketch.compression != NONE {
                let aligned = |range: &std::ops::Range<usize>, side: usize, end: usize| {
                    range.start.is_multiple_of(side) && (range.end.is_multiple_of(side) || range.end == end)
                };
                assert!(
                    aligned(&piece.x, sketch.chunk.0, size.0) && aligned(&piece.y, sketch.chunk.1, size.1)
                );
            }
        }
        assert!(seen.data().iter().all(|count| *count == 1), "{pieces:?}");
    }
}
