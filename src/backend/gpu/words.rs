//! Images, label ranges and label windows in words, as the shaders read them. Rows of images are made at once: on a GPU little else takes
//! time.

use super::uniform::LevelParams;
use crate::image::{Image, Pixel, Plane};
use crate::threads::prelude::*;

/// Writes pixels as red | green << 8 | blue << 16, | 1 << 24 if masked, to `words`, as long as that says all: as long as they are
/// in whole 8-bit levels, and grey follows from colour. Returns whether it does.
pub(super) fn narrow_words(image: &Image, pitch: u32, words: &mut [u32]) -> bool {
    words
        .par_chunks_exact_mut(pitch as usize)
        .enumerate()
        .all(|(y, row)| narrow_row(image.pixels.row(y), image.masked.row(y), row))
}

#[pulp::with_simd(narrow_row = crate::vectors::widest())]
#[inline(always)]
fn narrow_row_on<S: pulp::Simd>(_: S, pixels: &[Pixel], masked: &[bool], words: &mut [u32]) -> bool {
    let mut missed = 0;
    for ((word, pixel), &masked) in words.iter_mut().zip(pixels).zip(masked) {
        let [r, g, b, grey] = pixel.map(u32::from);
        // The grey of the colour, times 1000 and before it is rounded down.
        let above = (299 * r + 587 * g + 114 * b + 500).wrapping_sub(1000 * grey);
        missed |= (r | g | b) & 0xff | u32::from(above >= 1000);
        *word = r >> 8 | g | b << 8 | u32::from(masked) << 24;
    }
    missed == 0
}

/// Pixels as the stages read them: red | green << 16, blue | grey << 16, 1 if masked, 0.
pub(super) fn image_words(image: &Image, pitch: u32) -> Vec<u32> {
    let pitch = 4 * pitch as usize;
    let mut words = vec![0; pitch * image.height()];
    words.par_chunks_exact_mut(pitch).enumerate().for_each(|(y, row)| {
        let pixels = image.pixels.row(y).iter().zip(image.masked.row(y));
        for (out, (pixel, &masked)) in row.chunks_exact_mut(4).zip(pixels) {
            let [r, g, b, grey] = pixel.map(u32::from);
            out.copy_from_slice(&[r | g << 16, b | grey << 16, masked.into(), 0]);
        }
    });
    words
}

/// Pixels of a full size as the stages read them: red | green << 8 | blue << 16, each in 8 bits and rounded down, | 1 << 24 if
/// masked; grey.
pub(super) fn full_words(image: &Image, pitch: u32) -> Vec<u32> {
    let pitch = 2 * pitch as usize;
    let mut words = vec![0; pitch * image.height()];
    words.par_chunks_exact_mut(pitch).enumerate().for_each(|(y, row)| {
        let pixels = image.pixels.row(y).iter().zip(image.masked.row(y));
        for (out, (pixel, &masked)) in row.as_chunks_mut().0.iter_mut().zip(pixels) {
            let [r, g, b, grey] = pixel.map(u32::from);
            *out = [r >> 8 | g >> 8 << 8 | b >> 8 << 16 | u32::from(masked) << 24, grey];
        }
    });
    words
}

/// First and last label of each pixel, first | last << 16.
pub(super) fn label_range_words(label_ranges: &Plane<[u16; 2]>, params: &LevelParams) -> Vec<u32> {
    let pitch = params.pixel_pitch as usize;
    let mut words = vec![0; pitch * label_ranges.height()];
    for (y, row) in words.chunks_exact_mut(pitch).enumerate() {
        for (word, &[first, last]) in row.iter_mut().zip(label_ranges.row(y)) {
            *word = u32::from(first) | u32::from(last) << 16;
        }
    }
    words
}

/// Label windows, first label | number of labels with padding << 16.
pub(super) fn window_words(windows: &Plane<[u16; 2]>) -> Vec<u32> {
    windows.data().iter().map(|&[first, count]| u32::from(first) | u32::from(count) << 16).collect()
}
