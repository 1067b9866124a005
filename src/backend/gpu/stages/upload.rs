//! Unpacks uploaded images: those in whole 8-bit levels are uploaded as one word per pixel. Pairs that are
//! matched at half their size are halved here.

use crate::backend::gpu::commands::Recorder;
use crate::backend::gpu::frame::PixelFormat;
use crate::backend::gpu::kernel::{Variant, shader};
use crate::backend::gpu::uniform::full_pitch;
use crate::error::Result;

shader! {
    "upload"(plan, level) { full_pitch: u32, is_opaque: u32, format: u32, last: u32 }
    unpack { left_words, right_words, left, right } if plan.full.is_none() => Variant::new(0);
    halve { full_left_words, full_right_words, full_left, full_right, left, right } if plan.full.is_some() => {
        Variant::new(2 * 4)
    };
}

/// The meaning of the bytes of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Unpacking {
    /// Whether the highest byte counts for nothing; otherwise it masks pixels.
    pub(crate) is_opaque: bool,
    pub(crate) format: PixelFormat,
    /// The last column that the words hold, which the columns behind it repeat.
    pub(crate) last: u32,
}

impl Unpacking {
    /// The words of the host, which hold all columns.
    pub(crate) const OF_HOST: Self = Self { is_opaque: false, format: PixelFormat::Rgba, last: u32::MAX };
}

/// Unpacks the words of the pair.
pub(super) fn record(r: &mut Recorder, unpacking: Unpacking) -> Result<()> {
    let (plan, width) = (r.plan, r.params().width);
    let own = Uniform {
        full_pitch: full_pitch(plan),
        is_opaque: unpacking.is_opaque.into(),
        format: match unpacking.format {
            PixelFormat::Rgba => 0,
            PixelFormat::Bgra => 1,
            PixelFormat::Grey => 2,
        },
        last: unpacking.last,
    };
    r.rows(&if plan.full.is_some() { halve(plan, 0) } else { unpack(plan, 0) }, &own, width)
}
