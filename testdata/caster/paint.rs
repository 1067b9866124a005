//! Textures of bodies.

use super::noise::{noise, octaves};
use super::vector::{Vec3, mix, scale};

#[derive(Clone, Copy)]
pub enum Pattern {
    /// Only the first colour.
    Plain,
    /// A slow gradient between the two colours, over about this length.
    Wash(f64),
    /// Patches of this size with ragged borders.
    Blotches(f64),
    /// Stripes along the body's x axis, with this period.
    Stripes(f64),
    /// Rings along the body's z axis, with this period.
    Rings(f64),
    /// Cubes of this size.
    Checker(f64),
}

/// A pattern of two colours with band-limited grain, as a solid texture.
#[derive(Clone, Copy)]
pub struct Paint {
    pattern: Pattern,
    colours: [Vec3; 2],
    /// Standard deviation of the grain, relative to the colour.
    grain: f64,
    /// Size of the coarsest grain.
    cell: f64,
    /// Fraction of the light that is reflected as by a mirror, in addition to the diffuse colour.
    pub gloss: f64,
    /// Scale of the body coordinates before the lookup of the grain: below 1 stretches it.
    stretch: Vec3,
}

/// A paint of two colours, given as 0xRRGGBB, with a medium grain.
pub fn paint(pattern: Pattern, colours: [u32; 2]) -> Paint {
    let colours = colours.map(|c| [c >> 16, c >> 8, c].map(|byte| f64::from(byte & 255) / 255.0));
    Paint { pattern, colours, grain: 0.16, cell: 0.12, gloss: 0.0, stretch: [1.0; 3] }
}

impl Paint {
    pub fn grain(self, grain: f64, cell: f64) -> Self {
        Self { grain, cell, ..self }
    }

    pub fn stretch(self, stretch: Vec3) -> Self {
        Self { stretch, ..self }
    }

    pub fn gloss(self, gloss: f64) -> Self {
        Self { gloss, ..self }
    }

    /// The colour at a point of the body; details finer than about `pixel` are suppressed.
    pub fn colour(&self, p: Vec3, pixel: f64, seed: u32) -> Vec3 {
        let odd = |cells: f64| if cells.floor() as i64 & 1 == 0 { 0.0 } else { 1.0 };
        let t = match self.pattern {
            Pattern::Plain => 0.0,
            Pattern::Wash(size) => 0.5 + 0.7 * noise(scale(p, 1.0 / size), seed ^ 1),
            Pattern::Blotches(size) => 0.5 + 2.0 * octaves(p, size, pixel, 0.45, seed ^ 1),
            Pattern::Stripes(period) => odd(2.0 * p[0] / period),
            Pattern::Rings(period) => odd(2.0 * p[2] / period),
            Pattern::Checker(size) => odd(p.iter().map(|c| (c / size).floor()).sum()),
        };
        let base = mix(self.colours[0], self.colours[1], t.clamp(0.0, 1.0));
        if self.grain == 0.0 {
            return base;
        }
        let q = [p[0] * self.stretch[0], p[1] * self.stretch[1], p[2] * self.stretch[2]];
        let grain = octaves(q, self.cell, pixel, 0.8, seed).clamp(-2.5, 2.5);
        scale(base, 1.0 + self.grain * grain)
    }
}
