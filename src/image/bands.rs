//! Writes maps from bands of rows, so that a map larger than memory needs none to be written.

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use tiff::{TiffError, TiffResult};

use super::picture::png_or_tiff_size;
use super::save::Growing;
use super::write::{self, Format, Writer, is_special, png_levels};
use super::{Plane, pfm, tiff as tiff_file};
use crate::error::{Error, Result};

/// Bands of rows of a map, all as wide as the map and together as high, from the top.
pub type Bands<'a, T> = &'a mut dyn Iterator<Item = Result<Plane<T>>>;

impl Writer {
    /// Like [`Writer::disparity`], for a map of (width, height) pixels, from its bands.
    ///
    /// # Errors
    /// The errors of [`Writer::disparity`], and that of a band, which leaves no file.
    pub fn disparity_in_bands(&self, path: &Path, size: (usize, usize), bands: Bands<'_, f32>) -> Result<()> {
        let is_small = size.0 * size.1 <= tiff_file::MAX_PLAIN;
        match write::format(path)? {
            // A pipe takes the rows in the order of the file.
            _ if is_small || is_special(path) => self.disparity(path, &joined(size, bands)?),
            Format::Pfm => write_pfm(path, size, bands),
            Format::Png => {
                let levels = |band: Result<Plane<f32>>| {
                    let band = band?;
                    let levels = png_levels(&band).map_err(|reason| Error::write(path, reason))?;
                    Ok(Plane::new(band.width(), band.height(), levels))
                };
                picture_in_bands(path, size, &mut bands.map(levels))
            }
            Format::Tiff => self.write_tiff(path, size, bands),
        }
    }

    fn write_tiff(&self, path: &Path, size: (usize, usize), bands: Bands<'_, f32>) -> Result<()> {
        let size = png_or_tiff_size(path, size)?;
        let mut file = Growing::new(path)?;
        // The encoder passes its own errors on only.
        let mut failed = None;
        let bands = bands.map(|band| match band {
            Ok(band) => Ok(band.map(|&d| if d.is_finite() { d } else { f32::NAN })),
            Err(e) => {
                failed = Some(e);
                TiffResult::Err(TiffError::IoError(std::io::ErrorKind::Other.into()))
            }
        });
        let written = tiff_file::write_bands(&mut file, size, bands, self.georeference.as_ref());
        if let Some(e) = failed {
            return Err(e);
        }
        written.map_err(|e| match e {
            TiffError::IoError(e) => Error::write(path, e),
            e => Error::write(path, e.to_string()),
        })?;
        file.finish()
    }
}

/// The whole map.
fn joined<T>((width, height): (usize, usize), bands: Bands<'_, T>) -> Result<Plane<T>> {
    let mut values = Vec::with_capacity(width * height);
    for band in bands {
        values.extend(band?.into_data());
    }
    Ok(Plane::new(width, height, values))
}

/// Writes PFM, whose rows go from the bottom to the top.
fn write_pfm(path: &Path, (width, height): (usize, usize), bands: Bands<'_, f32>) -> Result<()> {
    let io = |e| Error::write(path, e);
    let mut file = Growing::new(path)?;
    let header = pfm::header((width, height));
    file.write_all(header.as_bytes()).map_err(io)?;
    let mut left = height;
    for band in bands {
        let band = band?.map(|&d| if d.is_finite() { d } else { f32::INFINITY });
        left -= band.height();
        file.seek(SeekFrom::Start((header.len() + left * width * size_of::<f32>()) as u64)).map_err(io)?;
        let mut bytes = Vec::new();
        pfm::encode_rows(&band, &mut bytes);
        file.write_all(&bytes).map_err(io)?;
    }
    assert_eq!(left, 0, "bands of the whole map");
    file.finish()
}

/// A pixel of a picture of grey levels.
pub trait Level: bytemuck::Pod {
    /// The bits of a level.
    const BITS: u8;

    /// The bytes of levels as PNG stores them.
    fn stored(levels: &[Self]) -> Vec<u8>;
}

impl Level for u8 {
    const BITS: u8 = 8;

    fn stored(levels: &[Self]) -> Vec<u8> {
        levels.to_vec()
    }
}

impl Level for u16 {
    const BITS: u8 = 16;

    fn stored(levels: &[Self]) -> Vec<u8> {
        levels.iter().flat_map(|level| level.to_be_bytes()).collect()
    }
}

/// Like [`write::picture`], for grey levels of (width, height) pixels, from bands.
///
/// # Errors
/// The errors of [`write::picture`], and that of a band, which leaves no file.
pub fn picture_in_bands<L: Level>(path: &Path, size: (usize, usize), bands: Bands<'_, L>) -> Result<()> {
    let (width, height) = png_or_tiff_size(path, size)?;
    let failed = |e: png::EncodingError| match e {
        png::EncodingError::IoError(e) => Error::write(path, e),
        e => Error::write(path, e.to_string()),
    };
    let mut file = Growing::new(path)?;
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(if L::BITS == 8 { png::BitDepth::Eight } else { png::BitDepth::Sixteen });
    let mut header = encoder.write_header().map_err(failed)?;
    let mut stream = header.stream_writer().map_err(failed)?;
    for band in bands {
        stream.write_all(&L::stored(band?.data())).map_err(|e| Error::write(path, e))?;
    }
    stream.finish().map_err(failed)?;
    header.finish().map_err(failed)?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::super::read::Reader;
    use super::*;
    use std::fs;

    fn map(width: usize, height: usize) -> Plane<f32> {
        Plane::from_fn(width, height, |x, y| {
            if (x * 31 + y * 7) % 97 < 5 { f32::NAN } else { ((x * 7 + y * 3) % 4000) as f32 / 16.0 }
        })
    }

    /// Bands of uneven heights.
    fn bands<T: Copy>(map: &Plane<T>) -> Vec<Result<Plane<T>>> {
        let mut bands = Vec::new();
        let mut y = 0;
        for rows in [1, 300, 7, 255].into_iter().cycle() {
            let end = (y + rows).min(map.height());
            bands.push(Ok(map.crop(&super::super::Rect { x: 0..map.width(), y: y..end })));
            y = end;
            if y == map.height() {
                return bands;
            }
        }
        unreachable!("the bands reach the end")
    }

    #[test]
    fn bands_make_the_map() {
        let folder = tempfile::tempdir().unwrap();
        // In one piece, and by bands.
        for size in [(40, 30), (2100, 2003)] {
            let map = map(size.0, size.1);
            for name in ["a.pfm", "a.tif", "a.png"] {
                let [whole, made] = ["whole", "made"].map(|by| folder.path().join(format!("{by}.{name}")));
                Writer::default().disparity(&whole, &map).unwrap();
                Writer::default().disparity_in_bands(&made, size, &mut bands(&map).into_iter()).unwrap();
                let [found, expected] =
                    [&made, &whole].map(|path| Reader::default().disparity(path).unwrap());
                assert!(found == expected, "{name}, {size:?}");
                if name != "a.png" {
                    assert!(fs::read(&whole).unwrap() == fs::read(&made).unwrap(), "{name}, {size:?}");
                }
            }
            let bytes = map.map(|d| if d.is_nan() { 9 } else { *d as u8 });
            let path = folder.path().join("bytes.png");
            picture_in_bands(&path, size, &mut bands(&bytes).into_iter()).unwrap();
            assert!(super::super::read::grey8(&path).unwrap() == bytes);
        }
    }

    #[test]
    fn a_band_that_fails_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let map = map(2100, 2003);
        for name in ["a.pfm", "a.tif", "a.png"] {
            let path = folder.path().join(name);
            let mut some = bands(&map);
            let last = some.len() - 1;
            some[last] = Err(Error::Interrupted);
            let said = Writer::default().disparity_in_bands(&path, map.size(), &mut some.into_iter());
            assert_eq!(said, Err(Error::Interrupted), "{name}");
            assert!(!path.exists(), "{name}");
        }
    }
}
