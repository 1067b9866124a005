//! Pairs at a fraction of their size, for what needs to see all of a pair that is larger than memory.

use super::PairWindows;
use crate::error::Result;
use crate::image::{Image, Pair, Plane, Rect};

/// Most pixels of the bands of rows that an overview is made from.
const BAND: usize = 1 << 22;

/// A pair at a fraction of its size.
#[derive(Clone, Debug)]
pub struct Overview {
    /// The smaller pair: each pixel is the mean of a square of the whole pair.
    pub pair: Pair,
    /// Width and height of a square in pixels: a power of two. Disparities in the whole pair are this many times those in the smaller one.
    pub factor: usize,
}

impl PairWindows {
    /// The pair at the largest fraction of its size that has at most `pixels` pixels, or the whole pair. Up to `factor` - 1 columns at
    /// the right and rows at the bottom are left out.
    ///
    /// # Errors
    /// The errors of [`PairWindows::window`].
    pub fn overview(&self, pixels: usize) -> Result<Overview> {
        let (width, height) = self.size();
        let fits = |factor: &usize| (width / factor) * (height / factor) <= pixels;
        let factors = std::iter::successors(Some(1), |factor| Some(2 * factor));
        let factor = factors.take_while(|factor| *factor < width.min(height)).find(fits).unwrap_or(1);
        let orientations = self.orientations();
        if factor == 1 {
            let pair = self.window(&Rect::whole(self.size()))?;
            return Ok(Overview { pair: Pair { orientations, ..pair }, factor });
        }
        let columns = width - width % factor;
        let rows = (BAND / columns).max(1).next_multiple_of(factor);
        let mut views = [Joined::default(), Joined::default()];
        for top in (0..height - height % factor).step_by(rows) {
            let bottom = (top + rows).min(height - height % factor);
            let band = self.window(&Rect { x: 0..columns, y: top..bottom })?;
            for (joined, image) in views.iter_mut().zip([band.left(), band.right()]) {
                joined.add(&smaller(image, factor));
            }
        }
        let [left, right] = views.map(|view| view.image(width / factor));
        Ok(Overview {
            pair: Pair { orientations, doubts: self.doubts.clone(), ..Pair::new(left, right)? },
            factor,
        })
    }
}

/// `image` with squares of `factor` x `factor` pixels, which divides its size, in the place of pixels.
fn smaller(image: &Image, factor: usize) -> Image {
    let half = image.halved();
    if factor == 2 { half } else { smaller(&half, factor / 2) }
}

/// An image that grows by bands.
#[derive(Default)]
struct Joined {
    pixels: Vec<crate::image::Pixel>,
    masked: Vec<bool>,
}

impl Joined {
    fn add(&mut self, band: &Image) {
        self.pixels.extend_from_slice(band.pixels.data());
        self.masked.extend_from_slice(band.masked.data());
    }

    fn image(self, width: usize) -> Image {
        let height = self.pixels.len() / width;
        Image {
            pixels: Plane::new(width, height, self.pixels),
            masked: Plane::new(width, height, self.masked),
        }
    }
}
