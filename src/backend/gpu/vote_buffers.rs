//! The buffers of the votes on filled pixels.

use super::allocator::Allocator;
use super::device::{Device, ONE_ROW};
use super::rows::Rows;
use super::uniform::{ALIGN_WORDS, LevelParams};
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::votes::{VOTE_REACH, Votes};
use crate::weights::vote_weights;

/// What votes on filled pixels take.
pub(super) struct VoteBuffers {
    /// Rows of half-size pixels whose votes are counted at a time.
    pub(super) band: u32,
    /// Words in a row of half-size pixels, and of their sums.
    pub(super) half_pitch: u32,
    pub(super) sum_pitch: u32,
    /// Half-size pixels: their colours, and what they vote for.
    pub(super) colours: Rows,
    pub(super) elected: Rows,
    /// Votes of a band and the rows around it, summed along rows, and of the band, along columns too.
    pub(super) sums: Rows,
    pub(super) totals: Rows,
    pub(super) weights: wgpu::Buffer,
}

impl VoteBuffers {
    pub(super) fn new(a: &mut Allocator, plan: &Plan, fine: &LevelParams) -> Result<Self> {
        let votes = Votes::of(plan);
        let pitch = |words: usize| words.next_multiple_of(ALIGN_WORDS) as u32;
        let (half_pitch, sum_pitch) = (pitch(votes.width), pitch(votes.width * votes.labels));
        let band = Self::band(a.device, votes, fine, sum_pitch)?;
        let votes = Votes { band: band as usize, ..votes };
        let mut rows = |label: &str, words: u32, count: usize| {
            Rows::in_parts(words, &[0, count as u32], |_, rows| {
                a.spare_or_new(label, u64::from(words) * rows)
            })
        };
        Ok(Self {
            band,
            half_pitch,
            sum_pitch,
            colours: rows("half-size image", half_pitch, votes.height)?,
            elected: rows("votes", half_pitch, votes.height)?,
            sums: rows("sums of votes", sum_pitch, votes.summed())?,
            totals: rows("totals of votes", sum_pitch, votes.band)?,
            weights: a.constant("weights of votes", &vote_weights().concat())?,
        })
    }

    /// As many rows as the plan says, or as the device can bind what they need of.
    fn band(device: &Device, votes: Votes, fine: &LevelParams, sum_pitch: u32) -> Result<u32> {
        let most = device.max_binding.min(device.max_buffer);
        let around = 2 * VOTE_REACH as u64;
        // Their sums, and two rows of flags and disparities each, with those around.
        let row = (4 * u64::from(sum_pitch)).max(8 * u64::from(fine.pixel_pitch));
        let rows = most / row;
        let summed = if rows >= votes.height as u64 { rows } else { rows.saturating_sub(around) };
        // Two rows of the image each, and two above and below.
        let image_row = 16 * u64::from(fine.pixel_pitch);
        let halved = (most / image_row).saturating_sub(4) / 2;
        let band = summed.min(halved).min(votes.band as u64);
        if band == 0 {
            return Err(device.too_large(ONE_ROW, ((1 + around) * row).max(6 * image_row), most));
        }
        Ok(band as u32)
    }
}
