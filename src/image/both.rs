//! Both views in one file of a stereo camera: MPO, two JPEG images in sequence, and JPS, one image with both.

use std::ops::Range;
use std::path::Path;

use super::Rect;
use super::decode::decode;
use super::file::damaged;
use super::jpeg;
use super::raster::Raster;
use crate::error::ReadError;

/// The signatures of the segments that describe the two views.
const MPO: &[u8] = b"MPF\0";
const JPS: &[u8] = b"_JPSJPS_";

/// Both views in the file `bytes`, called `path`, and whether the file says which is the left one.
pub(super) fn decode_both(
    path: &Path,
    bytes: &[u8],
    max_pixels: u64,
    no_data: Option<f64>,
    orient: bool,
) -> Result<([Raster<'static>; 2], bool), ReadError> {
    let read = |bytes: &[u8]| {
        let raster = decode(bytes, max_pixels, no_data)?.named(path);
        if orient { Ok::<_, ReadError>(raster.upright()?) } else { Ok(raster) }
    };
    if let Some(views) = index(bytes)? {
        let [left, right] = views.map(|view| bytes.get(view).map(read));
        let cut = || damaged("a view is missing");
        return Ok(([left.ok_or_else(cut)??, right.ok_or_else(cut)??], true));
    }
    let Some(halves) = Halves::find(path, bytes)? else {
        return Err(
            "holds one view; give the file of the right view too (files with both are .mpo and .jps)".into(),
        );
    };
    let whole = read(bytes)?;
    let (width, height) = whole.size();
    let (first, second) = if halves.above {
        (Rect { x: 0..width, y: 0..height / 2 }, Rect { x: 0..width, y: height / 2..height / 2 * 2 })
    } else {
        (Rect { x: 0..width / 2, y: 0..height }, Rect { x: width / 2..width / 2 * 2, y: 0..height })
    };
    let [first, second] =
        [first, second].map(|part| whole.crop(&part).map_err(|e| ReadError::from(e.to_string())));
    let views = if halves.left_first { [first?, second?] } else { [second?, first?] };
    Ok((views, halves.is_said))
}

/// The layout of an image with both views.
struct Halves {
    above: bool,
    left_first: bool,
    /// Whether the file states the layout.
    is_said: bool,
}

impl Halves {
    /// The layout from the file, or from its name: by default, a `.jps` is for cross-eyed viewing.
    fn find(path: &Path, bytes: &[u8]) -> Result<Option<Self>, ReadError> {
        let said = jpeg::segments(bytes)
            .find(|(marker, body)| *marker == 0xe3 && bytes[body.clone()].starts_with(JPS));
        let Some((_, body)) = said else {
            let is_jps = bytes.starts_with(&[0xff, 0xd8])
                && path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("jps"));
            return Ok(is_jps.then_some(Self { above: false, left_first: false, is_said: false }));
        };
        // After the signature and two bytes: separation of the views, flags, layout, and the kind of file.
        match bytes[body].get(JPS.len() + 2..).and_then(<[u8]>::first_chunk) {
            Some(&[_, flags, layout @ (2 | 3), 1]) => {
                Ok(Some(Self { above: layout == 3, left_first: flags & 4 != 0, is_said: true }))
            }
            Some([.., 1]) => {
                Err("holds both views mixed with each other; save them side by side, or as two files".into())
            }
            Some(_) => Ok(None),
            None => Err(damaged("the description of its views is cut off")),
        }
    }
}

/// The places of the two views in an MPO file; `None` if it is none.
fn index(bytes: &[u8]) -> Result<Option<[Range<usize>; 2]>, ReadError> {
    const IMAGES: usize = 0xb002;
    /// The kind of images that are reduced copies of others.
    const COPIES: u8 = 1;
    let said =
        jpeg::segments(bytes).find(|(marker, body)| *marker == 0xe2 && bytes[body.clone()].starts_with(MPO));
    let Some((_, body)) = said else { return Ok(None) };
    // The rest of the segment is laid out like a TIFF file, with offsets from here.
    let origin = body.start + MPO.len();
    let part = &bytes[origin..body.end];
    let lowest_first = part.starts_with(b"II");
    let number = |at: usize, count: usize| {
        let add = |all: usize, byte: &u8| all << 8 | usize::from(*byte);
        let bytes = part.get(at..at.checked_add(count)?)?;
        Some(if lowest_first { bytes.iter().rev().fold(0, add) } else { bytes.iter().fold(0, add) })
    };
    let images = || {
        let directory = number(4, 4)?;
        let entries = (0..number(directory, 2)?).map(|i| directory + 2 + 12 * i);
        let entry = entries.clone().find(|at| number(*at, 2) == Some(IMAGES))?;
        let (length, start) = (number(entry + 4, 4)?, number(entry + 8, 4)?);
        let image = |at: usize| {
            let [kind, size, offset] = [number(at, 4)?, number(at + 4, 4)?, number(at + 8, 4)?];
            // The first image starts the file; the other offsets count from here.
            let first = if offset == 0 { 0 } else { origin.checked_add(offset)? };
            Some(((kind >> 16) as u8, first..first.checked_add(size)?))
        };
        (0..length / 16).map(|i| image(start.checked_add(16 * i)?)).collect::<Option<Vec<_>>>()
    };
    let images = images().ok_or_else(|| damaged("the list of its images is cut off"))?;
    let views: Vec<_> =
        images.into_iter().filter(|(kind, _)| *kind != COPIES).map(|(_, place)| place).collect();
    let count = views.len();
    <[_; 2]>::try_from(views).map(Some).map_err(|_| {
        format!(
            "holds {count} image{} and not two views; give the file of each view",
            if count == 1 { "" } else { "s" }
        )
        .into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::raster::Samples;
    use image::{GrayImage, ImageFormat, Luma};
    use std::io::Cursor;

    /// A JPEG file with a block of each grey, and a segment.
    fn jpeg(levels: &[u8], segment: Option<(u8, &[u8])>) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let image = GrayImage::from_fn(8 * levels.len() as u32, 8, |x, _| Luma([levels[x as usize / 8]]));
        image.write_to(&mut file, ImageFormat::Jpeg).unwrap();
        let mut bytes = file.into_inner();
        if let Some((marker, body)) = segment {
            let length = (body.len() as u16 + 2).to_be_bytes();
            bytes.splice(2..2, [&[0xff, marker], &length[..], body].concat());
        }
        bytes
    }

    /// Images in sequence with a list of their kinds, in either byte order.
    fn mpo(levels: &[(u8, u8)], highest_first: bool) -> Vec<u8> {
        let number = |v: usize, count: usize| {
            let bytes = (v as u32).to_le_bytes()[..count].to_vec();
            if highest_first { bytes.into_iter().rev().collect() } else { bytes }
        };
        let plain: Vec<_> = levels.iter().map(|(level, _)| jpeg(&[*level], None)).collect();
        let body = |sizes: &[usize]| {
            let mut body = [MPO, if highest_first { b"MM\0*" } else { b"II*\0" }].concat();
            body.extend([number(8, 4), number(1, 2), number(0xb002, 2), number(7, 2)].concat());
            body.extend([number(16 * sizes.len(), 4), number(26, 4), number(0, 4)].concat());
            let mut start = 0;
            for ((_, kind), size) in levels.iter().zip(sizes) {
                // The list begins after the first marker, its own marker, its length and its signature.
                let offset = if start == 0 { 0 } else { start - 10 };
                body.extend(
                    [number(usize::from(*kind) << 16, 4), number(*size, 4), number(offset, 4), vec![0; 4]]
                        .concat(),
                );
                start += size;
            }
            body
        };
        let mut sizes: Vec<_> = plain.iter().map(Vec::len).collect();
        sizes[0] += body(&sizes).len() + 4;
        let first = jpeg(&[levels[0].0], Some((0xe2, &body(&sizes))));
        assert_eq!(first.len(), sizes[0]);
        [&[first], &plain[1..]].concat().concat()
    }

    fn levels(path: &str, bytes: &[u8]) -> Result<[u8; 2], String> {
        let (views, is_ordered) =
            decode_both(Path::new(path), bytes, 1 << 20, None, false).map_err(|e| e.to_string())?;
        assert_eq!(is_ordered, path != "a.jps");
        Ok(views.map(|view| {
            let Samples::Byte(samples) = view.samples() else { panic!("bytes") };
            samples[0]
        }))
    }

    #[test]
    fn two_images_in_sequence_are_views() {
        for highest_first in [false, true] {
            assert_eq!(levels("a.mpo", &mpo(&[(60, 3), (200, 2)], highest_first)), Ok([60, 200]));
            // A reduced copy between them.
            assert_eq!(levels("a.mpo", &mpo(&[(60, 3), (90, 1), (200, 2)], highest_first)), Ok([60, 200]));
        }
        let said = levels("a.mpo", &mpo(&[(60, 3), (90, 2), (200, 2)], false)).unwrap_err();
        assert!(said.contains("holds 3 images and not two views"), "{said}");
        let whole = mpo(&[(60, 3), (200, 2)], false);
        for length in 0..whole.len() {
            assert!(levels("a.mpo", &whole[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn halves_are_views() {
        let said = |flags: u8, layout: u8, kind: u8| {
            let body = [JPS, &[0, 4, 0, flags, layout, kind]].concat();
            levels("a.jpg", &jpeg(&[60, 200], Some((0xe3, &body))))
        };
        assert_eq!(said(4, 2, 1), Ok([60, 200]));
        assert_eq!(said(0, 2, 1), Ok([200, 60]));
        assert_eq!(levels("a.jps", &jpeg(&[60, 200], None)), Ok([200, 60]));
        assert!(said(0, 4, 1).unwrap_err().contains("mixed"));
        for one in
            [said(0, 2, 0), levels("a.jpg", &jpeg(&[60, 200], None)), levels("a.jps", b"P5 1 1 255\n\0")]
        {
            assert!(one.unwrap_err().contains("holds one view"));
        }
        let body = [JPS, &[0, 4, 0, 4, 3, 1]].concat();
        let views = decode_both(Path::new("a"), &jpeg(&[60, 200], Some((0xe3, &body))), 1 << 20, None, false);
        assert_eq!(views.unwrap().0.map(|view| view.size()), [(16, 4); 2]);
    }
}
