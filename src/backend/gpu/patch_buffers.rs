//! The buffers of planes that are carried from patch to patch.

use super::allocator::Allocator;
use super::device::ONE_ROW;
use super::rows::Rows;
use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::patches::{PATCH, PATCH_OWN_WORDS, PATCH_SUM_WORDS, patches};
use crate::weights::patch_weights;

/// What planes from far away take.
pub(super) struct PatchBuffers {
    /// Rows of patches that are worked on at a time.
    pub(super) band: u32,
    /// Words in a row of what patches have of their own, and of sums.
    pub(super) own_pitch: u32,
    pub(super) sum_pitch: u32,
    pub(super) own: Rows,
    pub(super) sums: Rows,
    pub(super) back: Rows,
    pub(super) shares: wgpu::Buffer,
}

impl PatchBuffers {
    pub(super) fn new(a: &mut Allocator, plan: &Plan, fine: &LevelParams) -> Result<Self> {
        let (width, height) = patches(plan);
        let pitch = |words: usize| (words * width).next_multiple_of(ALIGN_WORDS) as u32;
        let (own_pitch, sum_pitch) = (pitch(PATCH_OWN_WORDS), pitch(PATCH_SUM_WORDS));
        // The left image is the largest of what is bound beside.
        let image_row = 16 * u64::from(fine.pixel_pitch) * PATCH as u64;
        let row = (4 * u64::from(own_pitch)).max(image_row);
        let most = a.device.max_binding.min(a.device.max_buffer);
        // With a row above or below.
        let band = (most / row).saturating_sub(1).min(height as u64) as u32;
        if band == 0 {
            return Err(a.device.too_large(ONE_ROW, 2 * row, most));
        }
        let mut rows = |label: &str, words: u32| {
            Rows::in_parts(words, &[0, height as u32], |_, rows| {
                a.spare_or_new(label, u64::from(words) * rows)
            })
        };
        Ok(Self {
            band,
            own_pitch,
            sum_pitch,
            own: rows("patches", own_pitch)?,
            sums: rows("sums of patches", sum_pitch)?,
            back: rows("planes of patches", sum_pitch)?,
            shares: a.constant("weights of patches", &patch_weights())?,
        })
    }
}
