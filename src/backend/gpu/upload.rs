//! Images, graphs and label ranges as the shaders read them.

use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::graph::LevelGraph;
use crate::image::{Image, Plane};

/// Pixels as the shaders read them: red | green << 16, blue | grey << 16, 1 if masked, 0.
pub(super) fn image_words(image: &Image, pitch: u32) -> Vec<u32> {
    let pitch = 4 * pitch as usize;
    let mut words = vec![0; pitch * image.height()];
    for (y, row) in words.chunks_exact_mut(pitch).enumerate() {
        let pixels = image.pixels.row(y).iter().zip(image.masked.row(y));
        for (out, (pixel, &masked)) in row.chunks_exact_mut(4).zip(pixels) {
            let [r, g, b, grey] = pixel.map(u32::from);
            out.copy_from_slice(&[r | g << 16, b | grey << 16, masked.into(), 0]);
        }
    }
    words
}

/// Codes of the factors' neighbours, four per word.
pub(super) fn member_words(graph: &LevelGraph, params: &LevelParams) -> Vec<u32> {
    let neighbours = graph.slots() - 1;
    let (per_pixel, pitch) = (neighbours.div_ceil(4), params.member_pitch as usize);
    let mut words = vec![u32::MAX; pitch * graph.height()];
    if neighbours > 0 {
        for (factor, codes) in graph.codes().chunks_exact(neighbours).enumerate() {
            let (x, y) = (factor % graph.width(), factor / graph.width());
            for (slot, &code) in codes.iter().enumerate() {
                let word = &mut words[y * pitch + x * per_pixel + slot / 4];
                let shift = 8 * (slot % 4);
                *word = *word & !(0xff << shift) | u32::from(code) << shift;
            }
        }
    }
    words
}

/// The transposed table, as the shader reads it.
pub(super) struct Incoming {
    /// Start of each pixel's entries, with one more per row.
    pub(super) starts: Vec<u32>,
    pub(super) entries: Vec<u32>,
    /// Start of each row's entries, aligned so that any range of rows can be bound, and the end.
    pub(super) rows: Vec<u32>,
}

pub(super) fn transposed(graph: &LevelGraph, params: &LevelParams) -> Incoming {
    let (width, pitch) = (graph.width(), params.starts_pitch as usize);
    let mut starts = vec![0; pitch * graph.height()];
    let mut entries = Vec::with_capacity(graph.incoming().len() + ALIGN_WORDS * graph.height());
    let mut rows = vec![0];
    for (y, starts) in starts.chunks_exact_mut(pitch).enumerate() {
        for (x, start) in starts[..width].iter_mut().enumerate() {
            *start = entries.len() as u32;
            entries.extend(graph.incoming_of(y * width + x).iter().map(|entry| u32::from(entry.bits())));
        }
        starts[width] = entries.len() as u32;
        entries.resize(entries.len().next_multiple_of(ALIGN_WORDS), 0);
        rows.push(entries.len() as u32);
    }
    Incoming { starts, entries, rows }
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
