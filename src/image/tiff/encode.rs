//! Encodes maps as float TIFF: plain, or in compressed tiles if they are large.

use std::io::{self, Cursor, Seek, Write};

use tiff::TiffResult;
use tiff::encoder::colortype::Gray32Float;
use tiff::encoder::compression::{CompressionAlgorithm, Deflate, DeflateLevel};
use tiff::encoder::{DirectoryEncoder, TiffEncoder, TiffKind, TiffValue};
use tiff::tags::{CompressionMethod, PhotometricInterpretation, Predictor, SampleFormat, Tag};

use crate::image::Plane;
use crate::image::georeference::Georeference;
use crate::threads;
use crate::threads::prelude::*;

/// Most pixels of a plain map. A few programs cannot read tiles and Deflate, which small maps do not need.
pub(in crate::image) const MAX_PLAIN: usize = 1 << 22;
/// Limit for plain TIFF, whose offsets end at 4 GiB; this leaves room for the tags. Few programs read
/// BigTIFF, so it is used only if needed.
const MAX_BYTES: usize = u32::MAX as usize - (1 << 25);
/// Width and height of a tile.
const SIDE: usize = 256;

/// Encodes a map, whose values are written unchanged; NaN is the no-data value.
pub(in crate::image) fn encode(
    map: &Plane<f32>,
    size: (u32, u32),
    georeference: Option<&Georeference>,
) -> TiffResult<Vec<u8>> {
    let mut file = Cursor::new(Vec::new());
    if map.data().len() <= MAX_PLAIN {
        let mut encoder = TiffEncoder::new(&mut file)?;
        let mut image = encoder.new_image::<Gray32Float>(size.0, size.1)?;
        annotate(image.encoder(), georeference)?;
        image.write_data(map.data())?;
    } else {
        write_tiles(&mut file, size, packed_tiles(map)?, georeference, MAX_BYTES)?;
    }
    Ok(file.into_inner())
}

/// Writes the tags that do not describe the format of the pixels.
fn annotate<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<W, K>,
    georeference: Option<&Georeference>,
) -> TiffResult<()> {
    for field in georeference.iter().flat_map(|georeference| georeference.fields.iter()) {
        let entry = directory.write_entry_bytes(field.kind, &field.bytes)?;
        directory.extend_from(&[(field.tag, entry)].into_iter().collect());
        align(directory, field.bytes.len())?;
    }
    // GDAL's tag, which the programs based on GDAL read too.
    directory.write_tag(Tag::GdalNodata, "nan")
}

/// Aligns the file to an even offset.
fn align<W: Write + Seek, K: TiffKind>(
    directory: &mut DirectoryEncoder<W, K>,
    written: usize,
) -> TiffResult<()> {
    if !written.is_multiple_of(2) {
        directory.write_data(0_u8)?;
    }
    Ok(())
}

#[cfg(not(target_arch = "wasm32"))]
/// Writes a large map to `file` from bands of rows, from the top, of any heights that add up to its own; BigTIFF if the map may exceed
/// plain TIFF.
pub(in crate::image) fn write_bands(
    file: impl Write + Seek,
    size: (u32, u32),
    bands: impl Iterator<Item = TiffResult<Plane<f32>>>,
    georeference: Option<&Georeference>,
) -> TiffResult<()> {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let mut bands = bands.fuse();
    let (mut rest, mut left) = (Vec::new(), height);
    let rows = std::iter::from_fn(|| {
        let wanted = SIDE.min(left) * width;
        while rest.len() < wanted {
            match bands.next()? {
                Ok(band) => rest.extend(band.into_data()),
                Err(e) => return Some(Err(e)),
            }
        }
        left -= SIDE.min(left);
        let band = Plane::new(width, wanted / width, rest.drain(..wanted).collect());
        (wanted > 0).then(|| Ok(packed_tiles(&band)?))
    });
    if width * height * size_of::<f32>() > MAX_BYTES {
        write_directory(TiffEncoder::new_big(file)?, size, rows, georeference)
    } else {
        write_directory(TiffEncoder::new(file)?, size, rows, georeference)
    }
}

/// Writes a file of tiles; BigTIFF if they exceed `max_bytes`.
fn write_tiles(
    file: &mut Cursor<Vec<u8>>,
    size: (u32, u32),
    tiles: Vec<Vec<u8>>,
    georeference: Option<&Georeference>,
    max_bytes: usize,
) -> TiffResult<()> {
    let is_big = tiles.iter().map(Vec::len).sum::<usize>() > max_bytes;
    let tiles = std::iter::once(Ok(tiles));
    if is_big {
        write_directory(TiffEncoder::new_big(file)?, size, tiles, georeference)
    } else {
        write_directory(TiffEncoder::new(file)?, size, tiles, georeference)
    }
}

/// Writes the packed tiles, in groups, and then the tags.
fn write_directory<W: Write + Seek, K: TiffKind>(
    mut encoder: TiffEncoder<W, K>,
    (width, height): (u32, u32),
    tiles: impl Iterator<Item = TiffResult<Vec<Vec<u8>>>>,
    georeference: Option<&Georeference>,
) -> TiffResult<()>
where
    K::OffsetArrayType: TiffValue,
{
    let mut directory = encoder.image_directory()?;
    let (mut offsets, mut sizes) = (Vec::new(), Vec::new());
    for group in tiles {
        for tile in group? {
            offsets.push(K::convert_offset(directory.write_data(&tile[..])?)?);
            sizes.push(K::convert_offset(tile.len() as u64)?);
            align(&mut directory, tile.len())?;
        }
    }
    directory.write_tag(Tag::ImageWidth, width)?;
    directory.write_tag(Tag::ImageLength, height)?;
    directory.write_tag(Tag::BitsPerSample, 32_u16)?;
    directory.write_tag(Tag::SampleFormat, SampleFormat::IEEEFP.to_u16())?;
    directory.write_tag(Tag::SamplesPerPixel, 1_u16)?;
    directory.write_tag(Tag::PhotometricInterpretation, PhotometricInterpretation::BlackIsZero.to_u16())?;
    directory.write_tag(Tag::Compression, CompressionMethod::Deflate.to_u16())?;
    directory.write_tag(Tag::Predictor, Predictor::FloatingPoint.to_u16())?;
    directory.write_tag(Tag::TileWidth, SIDE as u32)?;
    directory.write_tag(Tag::TileLength, SIDE as u32)?;
    directory.write_tag(Tag::TileOffsets, K::convert_slice(&offsets))?;
    directory.write_tag(Tag::TileByteCounts, K::convert_slice(&sizes))?;
    annotate(&mut directory, georeference)?;
    directory.finish()
}

/// All tiles, row by row.
fn packed_tiles(map: &Plane<f32>) -> io::Result<Vec<Vec<u8>>> {
    let (across, down) = (map.width().div_ceil(SIDE), map.height().div_ceil(SIDE));
    let tiles = (0..across * down).into_par_iter();
    threads::run(|| tiles.map(|i| packed_tile(map, i % across * SIDE, i / across * SIDE)).collect())
}

/// A tile with the predictor of floats, compressed by Deflate. Beyond the map it holds NaN.
fn packed_tile(map: &Plane<f32>, left: usize, top: usize) -> io::Result<Vec<u8>> {
    let right = map.width().min(left + SIDE);
    let mut bytes = Vec::with_capacity(SIDE * SIDE * size_of::<f32>());
    let mut row = [f32::NAN; SIDE];
    for y in top..top + SIDE {
        if y < map.height() {
            row[..right - left].copy_from_slice(&map.row(y)[left..right]);
        } else {
            row.fill(f32::NAN);
        }
        predict(&row, &mut bytes);
    }
    let mut packed = Vec::new();
    Deflate::with_level(DeflateLevel::Fast).write_to(&mut packed, &bytes)?;
    Ok(packed)
}

/// The differences between the bytes of a row of floats, in planes, the highest byte first.
fn predict(row: &[f32], bytes: &mut Vec<u8>) {
    let start = bytes.len();
    for place in 0..size_of::<f32>() {
        bytes.extend(row.iter().map(|value| value.to_be_bytes()[place]));
    }
    for i in (start + 1..bytes.len()).rev() {
        bytes[i] = bytes[i].wrapping_sub(bytes[i - 1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiff::decoder::{Decoder, DecodingResult};

    fn map(width: usize, height: usize) -> Plane<f32> {
        Plane::from_fn(width, height, |x, y| {
            if x * y % 97 == 5 { f32::NAN } else { (x * 7 + y * 3) as f32 / 256.0 - 9.0 }
        })
    }

    /// The values that another decoder finds, as bits, and whether the file is BigTIFF.
    fn read(file: &[u8]) -> (Vec<u32>, bool) {
        let mut decoder = Decoder::new(Cursor::new(file)).unwrap();
        let DecodingResult::F32(values) = decoder.read_image().unwrap() else { panic!("float") };
        (values.into_iter().map(f32::to_bits).collect(), file[2] == 43)
    }

    #[test]
    fn tiles_survive_a_round_trip() {
        for (width, height) in [(1, 1), (256, 256), (257, 255), (600, 513)] {
            let map = map(width, height);
            let bits: Vec<u32> = map.data().iter().map(|v| v.to_bits()).collect();
            let tiles = packed_tiles(&map).unwrap();
            for (max_bytes, big) in [(MAX_BYTES, false), (0, true)] {
                let mut file = Cursor::new(Vec::new());
                write_tiles(&mut file, (width as u32, height as u32), tiles.clone(), None, max_bytes)
                    .unwrap();
                assert_eq!(read(file.get_ref()), (bits.clone(), big), "{width} x {height}");
                let raster = super::super::decode(file.get_ref(), 1 << 20, None).unwrap();
                let crate::image::raster::Samples::Float(values) = raster.samples else { panic!("float") };
                assert!(values.iter().map(|v| v.to_bits()).eq(bits.iter().copied()));
            }
        }
    }

    #[test]
    fn large_maps_are_packed() {
        let size = |width: usize| {
            let map = map(width, 2048);
            let file = encode(&map, (width as u32, 2048), None).unwrap();
            assert_eq!(read(&file).0, map.data().iter().map(|v| v.to_bits()).collect::<Vec<_>>());
            file.len()
        };
        assert!(size(2048) > 4 * MAX_PLAIN);
        assert!(size(2049) < 4 * MAX_PLAIN / 2);
    }
}
