//! The buffers of planes that are carried from patch to patch.

use super::allocator::Allocator;
use super::device::ONE_ROW;
use super::rows::Rows;
use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::patches::{PATCH, PATCH_WORDS, patches};
use crate::weights::patch_weights;

/// What planes from far away take.
pub(super) struct PatchBuffers {
    /// Rows of patches that are worked on at a time.
    pub(super) band: u32,
    /// Words in a row of patches.
    pub(super) pitch: u32,
    pub(super) patches: Rows,
    pub(super) shares: wgpu::Buffer,
}

impl PatchBuffers {
    pub(super) fn new(a: &mut Allocator, plan: &Plan, fine: &LevelParams) -> Result<Self> {
        let (width, height) = patches(plan);
        let pitch = (PATCH_WORDS * width).next_multiple_of(ALIGN_WORDS) as u32;
        // The left image is the largest of what is bound beside.
        let image_row = 16 * u64::from(fine.pixel_pitch) * PATCH as u64;
        let row = (4 * u64::from(pitch)).max(image_row);
        let most = a.device.max_binding.min(a.device.max_buffer);
        // With a row above and below.
        let rows = most / row;
        let band = if rows >= height as u64 { height as u64 } else { rows.saturating_sub(2) };
        if band == 0 {
            return Err(a.device.too_large(ONE_ROW, 3 * row, most));
        }
        let patches = Rows::in_parts(pitch, &[0, height as u32], |_, rows| {
            a.spare_or_new("patches", u64::from(pitch) * rows)
        })?;
        let shares = a.constant("weights of patches", &patch_weights())?;
        Ok(Self { band: band as u32, pitch, patches, shares })
    }
}
