//! The views of a pair, in memory or in files.

use mrfgs::check;
use mrfgs::image::Pair;
use mrfgs::options::DisparityRange;

/// The views of a pair: in memory, in files that are read by windows, or not read yet.
pub(crate) trait Views {
    /// (width, height) in pixels.
    fn size(&self) -> (usize, usize);

    /// The range of disparities by sparse matches; `doffs` is the offset of the principal points, if that is known.
    fn range(&self, doffs: Option<f64>) -> mrfgs::Result<DisparityRange>;
}

impl Views for Pair {
    fn size(&self) -> (usize, usize) {
        self.size()
    }

    fn range(&self, doffs: Option<f64>) -> mrfgs::Result<DisparityRange> {
        match doffs {
            Some(doffs) => check::range_of_cameras(self, doffs),
            None => check::range(self),
        }
    }
}
