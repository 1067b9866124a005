//! Integer costs: their unit, their widths, and the truncation of messages.

use crate::options::Method;

/// Units of cost per nat.
pub const UNITS_PER_NAT: f64 = 4.0;
/// Truncation of the messages of a hard potential, in units: the largest for which no belief saturates in 16
/// bits, even for a pixel in all 49 factors of its window, with two resolution messages and the largest
/// evidence.
pub const HARD_CAP: u16 = 1023;

/// Conversion from cost to evidence in 16-bit steps. With c in 1/256 cost units and D = min(c(d) - min c,
/// `limit`), e(d) = min(((D << `up`) * `multiplier` >> 16) + (1 << `down` >> 1) >> `down`, `cap`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EvidenceScale {
    /// Evidence units per 1/256 cost unit, times 2^(16 + `down` - `up`); below 2^15.
    pub multiplier: u16,
    /// The smallest cost difference that reaches the cap; larger differences are clamped to it.
    pub limit: u16,
    /// The largest shift that keeps `limit` in 16 bits.
    pub up: u32,
    /// Fractional bits of the product.
    pub down: u32,
    /// Largest evidence, in units.
    pub cap: u8,
}

impl EvidenceScale {
    pub(super) fn new(gain: f64, cost_units: f64, method: &Method) -> Self {
        let per_cost = gain * UNITS_PER_NAT / (method.messages.temperature * cost_units * 256.0);
        let cap = (method.messages.evidence_cap * UNITS_PER_NAT + 0.5).floor();
        let limit = (cap / per_cost).ceil().clamp(1.0, u16::MAX.into()) as u16;
        let up = limit.leading_zeros();
        let unshifted = per_cost * 65536.0 / f64::from(1u32 << up);
        // The multiplier uses 15 bits, so that product and rounding fit in 16.
        let mut down = 0;
        while down < 15 && unshifted * f64::from(2u32 << down) < 32767.0 {
            down += 1;
        }
        let multiplier = (unshifted * f64::from(1u32 << down) + 0.5).floor().clamp(1.0, 32767.0) as u16;
        Self { multiplier, limit, up, down, cap: cap as u8 }
    }

    /// Evidence for a cost `difference` from the pixel's best label, in 1/256 cost units.
    #[must_use]
    #[inline]
    pub fn apply(self, difference: u16) -> u8 {
        let product = (u32::from(difference.min(self.limit) << self.up) * u32::from(self.multiplier)) >> 16;
        // Both terms fit in 15 bits.
        let e = (product as u16 + (1 << self.down >> 1)) >> self.down;
        e.min(self.cap.into()) as u8
    }
}

/// Storage width of messages and beliefs. Their sums saturate at its largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeWidth {
    /// 8 bits.
    Narrow,
    /// 16 bits.
    Wide,
}

impl VolumeWidth {
    /// Bytes per value.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Narrow => 1,
            Self::Wide => 2,
        }
    }

    /// The largest value, used as infinity.
    #[must_use]
    pub fn most(self) -> u16 {
        match self {
            Self::Narrow => u8::MAX.into(),
            Self::Wide => u16::MAX,
        }
    }
}

/// Truncation of a sum of messages s to a message m(d) = min(s(d), high) - low. For an infinite sum, the
/// message is tau.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Truncation {
    /// Cost of disagreement, in units.
    pub tau: u16,
    /// The rule for the bounds.
    pub rule: TruncationRule,
}

/// The rule for the bounds (high, low) of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruncationRule {
    /// high = min s + tau, low = min s, where min s is at most infinity - tau.
    Relative,
    /// high = tau, low = 0, given that the members' messages have minimum 0.
    Absolute,
}

impl Truncation {
    /// (high, low) for the smallest sum `min`, with infinity `most`.
    #[must_use]
    pub fn bounds(self, min: u32, most: u32) -> (u32, u32) {
        let tau = u32::from(self.tau);
        match self.rule {
            TruncationRule::Relative => {
                let low = min.min(most - tau);
                (low + tau, low)
            }
            TruncationRule::Absolute => (tau, 0),
        }
    }
}

/// Converts a truncation to units, at least 1.
pub(super) fn units(nats: f64) -> u16 {
    ((nats * UNITS_PER_NAT + 0.5).floor() as u16).clamp(1, HARD_CAP)
}
