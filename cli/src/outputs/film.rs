//! Films of maps: YUV4MPEG2, or other formats through ffmpeg.

use std::io::Write;
use std::path::{Path, PathBuf};

use mrfgs::image::{Plane, write::Growing};
use mrfgs::{Error, Result};

use crate::console;
use crate::ffmpeg::{self, Encoder};
use crate::outputs::files::is_printed;

/// Frames per second if the input does not tell.
const RATE: (usize, usize) = (25, 1);

/// A film being written. The file appears on [`finish`](Self::finish).
pub(crate) struct Film {
    path: PathBuf,
    rate: (usize, usize),
    /// `None` before the first frame.
    sink: Option<Sink>,
}

/// The destination of the frames.
enum Sink {
    Printed,
    File(Growing),
    Encoded(Encoder),
}

impl Sink {
    fn new(path: &Path) -> Result<Self> {
        if is_printed(path) {
            Ok(Self::Printed)
        } else if ffmpeg::writes(path) {
            Encoder::new(path).map(Self::Encoded)
        } else {
            Growing::new(path).map(Self::File)
        }
    }
}

impl Film {
    /// A film at `path`, or `-` for standard output, with `rate` frames per second (a fraction).
    pub(crate) fn new(path: &Path, rate: Option<(usize, usize)>) -> Self {
        Self { path: path.to_owned(), rate: rate.unwrap_or(RATE), sink: None }
    }

    /// Adds a frame; all frames must have the same size.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written, or the reader of a pipe has left.
    pub(crate) fn add(&mut self, picture: &Plane<[u8; 3]>) -> Result<()> {
        let mut bytes = Vec::with_capacity(3 * picture.data().len() + 100);
        let sink = if let Some(sink) = &mut self.sink {
            sink
        } else {
            let ((width, height), (frames, seconds)) = (picture.size(), self.rate);
            let header = format!(
                "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} Ip A1:1 C444 XCOLORRANGE=LIMITED\n"
            );
            bytes.extend_from_slice(header.as_bytes());
            self.sink.insert(Sink::new(&self.path)?)
        };
        bytes.extend_from_slice(b"FRAME\n");
        let yuv: Vec<[u8; 3]> = picture.data().iter().map(|rgb| to_yuv(*rgb)).collect();
        (0..3).for_each(|plane| bytes.extend(yuv.iter().map(|pixel| pixel[plane])));
        match sink {
            Sink::Printed => console::print_data(&bytes, "film"),
            Sink::File(file) => file.write_all(&bytes).map_err(|e| Error::write(&self.path, e)),
            Sink::Encoded(film) => film.add(&bytes),
        }
    }

    /// Ends the film.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written.
    pub(crate) fn finish(self) -> Result<()> {
        match self.sink {
            Some(Sink::File(file)) => file.finish(),
            Some(Sink::Encoded(film)) => film.finish(),
            _ => Ok(()),
        }
    }
}

/// RGB to luma and chroma of ITU-R BT.601, limited range: black is 16, white 235.
fn to_yuv([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(i32::from);
    // Coefficients in 1/2^16.
    let sum = |offset: i32, sum: i32| ((sum + 32_768) / 65_536 + offset) as u8;
    let chroma = |sum: i32| ((sum + (128 << 16) + 32_768) >> 16) as u8;
    [
        sum(16, 16_829 * r + 33_039 * g + 6_416 * b),
        chroma(-9_714 * r - 19_070 * g + 28_784 * b),
        chroma(28_784 * r - 24_103 * g - 4_681 * b),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_the_standard() {
        let colours = [
            ([0, 0, 0], [16, 128, 128]),
            ([255, 255, 255], [235, 128, 128]),
            ([255, 0, 0], [82, 90, 240]),
            ([0, 255, 0], [145, 54, 34]),
            ([0, 0, 255], [41, 240, 110]),
        ];
        for (rgb, yuv) in colours {
            let off = to_yuv(rgb).iter().zip(yuv).map(|(a, b): (&u8, u8)| a.abs_diff(b)).max();
            assert!(off.is_some_and(|off| off <= 1), "{:?} for {rgb:?}, not {yuv:?}", to_yuv(rgb));
        }
    }
}
