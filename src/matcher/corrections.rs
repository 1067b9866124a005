//! Corrections that the frames of a video share.

use crate::error::Result;
use crate::front;
use crate::front::conditioning::Conditioning;
use crate::image::Pair;
use crate::options::DisparityRange;
use crate::plan::Plan;
use crate::watch::{Followed, Observer, Watch};

/// The last measured corrections of a video.
#[derive(Default)]
pub(super) struct Corrections(Option<Measured>);

/// The corrections of a frame, and the frames that share them.
struct Measured {
    corrections: Conditioning,
    size: (usize, usize),
    range: DisparityRange,
    /// The number of later frames that still take them.
    left: u32,
}

impl Corrections {
    /// The corrections of the next frame: those of an earlier one, or measured on this one. `None` if every frame is measured, which
    /// its match does.
    ///
    /// # Errors
    /// The errors of [`front::condition`].
    pub(super) fn of(
        &mut self,
        pair: &Pair,
        plan: &Plan,
        observer: Observer,
    ) -> Result<Option<Conditioning>> {
        let every = plan.method.front.measure_every;
        if every == 1 {
            return Ok(None);
        }
        let (size, range) = (pair.size(), plan.range);
        if let Some(last) =
            self.0.as_mut().filter(|last| (last.size, last.range) == (size, range) && last.left > 0)
        {
            last.left -= 1;
            return Ok(Some(last.corrections));
        }
        let mut watch = Watch::new(observer, Followed::default());
        let (_, corrections) = front::condition(pair, plan, &mut watch)?;
        self.0 = Some(Measured { corrections, size, range, left: every - 1 });
        Ok(Some(corrections))
    }
}
