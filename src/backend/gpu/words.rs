//! Images, label ranges and label windows as words for shaders. Rows of images are converted in parallel,
//! since this takes a large share of the host's time.

use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::image::{Image, Pixel, Plane};
use crate::plan::ROW_ALIGN;
use crate::stage::prior::LabelPrior;
use crate::threads::prelude::*;
use wgpu::WriteOnly;

/// Writes pixels as red | green << 8 | blue << 16, | 1 << 24 if masked, in rows of `pitch` words to `memory`.
/// Returns false if that loses information: if pixels are not in whole 8-bit levels, or grey does not follow from
/// colour.
#[cfg_attr(
    target_arch = "wasm32",
    expect(clippy::map_all_any_identity, reason = "one thread has plain iterators")
)]
pub(super) fn narrow_words(image: &Image, pitch: u32, memory: WriteOnly<'_, [u8]>) -> bool {
    let (width, per_row) = (image.width(), pitch as usize / ALIGN_WORDS);
    // Rows are whole blocks, and a block can move to another thread.
    let blocks: Vec<WriteOnly<'_, [u8; ROW_ALIGN]>> = memory.into_chunks().0.into_iter().collect();
    let write = |(i, block): (usize, WriteOnly<'_, [u8; ROW_ALIGN]>)| {
        let (y, x) = (i / per_row, ALIGN_WORDS * (i % per_row));
        let columns = x.min(width)..(x + ALIGN_WORDS).min(width);
        let mut words = [0; ALIGN_WORDS];
        let (pixels, masked) = (&image.pixels.row(y)[columns.clone()], &image.masked.row(y)[columns]);
        let is_narrow = narrow_row(pixels, masked, &mut words);
        // The memory may be slow to write in pieces.
        block.write(bytemuck::cast(words));
        is_narrow
    };
    blocks.into_par_iter().enumerate().map(write).all(|is_narrow| is_narrow)
}

#[pulp::with_simd(narrow_row = crate::vectors::widest())]
#[inline(always)]
fn narrow_row_on<S: pulp::Simd>(_: S, pixels: &[Pixel], masked: &[bool], words: &mut [u32]) -> bool {
    let mut missed = 0;
    for ((word, pixel), &masked) in words.iter_mut().zip(pixels).zip(masked) {
        let [r, g, b, grey] = pixel.map(u32::from);
        // 1000 times (the grey of the colour before rounding down, minus grey); below 1000 if they match.
        let above = (299 * r + 587 * g + 114 * b + 500).wrapping_sub(1000 * grey);
        missed |= (r | g | b) & 0xff | u32::from(above >= 1000);
        *word = r >> 8 | g | b << 8 | u32::from(masked) << 24;
    }
    missed == 0
}

/// Pixels for shaders: red | green << 16, blue | grey << 16, 1 if masked, 0.
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

/// Full-size pixels for shaders: red | green << 8 | blue << 16, each rounded down to 8 bits, | 1 << 24 if
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

/// First and last label of each pixel as first | last << 16.
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

/// The prior of each pixel of a level with `labels` labels, in two words.
pub(super) fn prior_words(prior: &Plane<LabelPrior>, labels: usize, params: &LevelParams) -> Vec<u32> {
    let pitch = 2 * params.pixel_pitch as usize;
    let mut words = vec![0; pitch * prior.height()];
    words.par_chunks_exact_mut(pitch).enumerate().for_each(|(y, row)| {
        let pixels = row.as_chunks_mut().0.iter_mut().zip(prior.row(y));
        pixels.for_each(|(words, prior)| *words = prior.words(labels));
    });
    words
}

/// The anchors, one word per pixel.
pub(super) fn anchor_words(anchors: &Plane<i32>, pitch: u32) -> Vec<u32> {
    let mut words = vec![0; pitch as usize * anchors.height()];
    for (y, row) in words.chunks_exact_mut(pitch as usize).enumerate() {
        row.iter_mut().zip(anchors.row(y)).for_each(|(word, anchor)| *word = anchor.cast_unsigned());
    }
    words
}

/// Label windows as first label | number of labels with padding << 16.
pub(super) fn window_words(windows: &Plane<[u16; 2]>) -> Vec<u32> {
    windows.data().iter().map(|&[first, count]| u32::from(first) | u32::from(count) << 16).collect()
}
