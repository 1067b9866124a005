//! What cameras record.

use super::noise::hash;
use super::vector::Vec3;

/// Where the point (x, y) of an image is, from its middle, when the image is one unit high.
pub fn place((width, height): (usize, usize), x: f64, y: f64) -> [f64; 2] {
    let scale = height as f64;
    [(x - middle(width)) / scale, (y - middle(height)) / scale]
}

/// The middle of so many pixels.
pub fn middle(pixels: usize) -> f64 {
    0.5 * (pixels - 1) as f64
}

/// What turns light (1 is white) into bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    pub gain: f64,
    /// The part of the light that is lost one image height away from `brightest`; it grows with the square of the
    /// distance.
    pub fall_off: f64,
    /// The place in the image that gets all light, in image heights from its middle.
    pub brightest: [f64; 2],
    /// Added after the gain, in grey levels.
    pub offset: f64,
    /// Standard deviation in grey levels.
    pub noise: f64,
    /// How far below its place everything is recorded, in pixels: the camera is not adjusted.
    pub lower: f64,
    /// Side of the square from which a pixel gets its light, in pixels: 1 in focus, more out of it.
    pub spread: f64,
    seed: u32,
}

impl Sensor {
    /// One in focus with a little noise, which gets all light.
    pub fn new(seed: u32) -> Self {
        Self {
            gain: 1.0,
            fall_off: 0.0,
            brightest: [0.0; 2],
            offset: 0.0,
            noise: 1.0,
            lower: 0.0,
            spread: 1.0,
            seed,
        }
    }

    /// The grey level that light makes at (x, y) of an image of this size, but for the noise.
    pub fn level(&self, light: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        255.0 * self.gain * light * self.passes(size, x, y) + self.offset
    }

    /// The light that makes this grey level at (x, y): [`Self::level`] the other way round.
    pub fn light(&self, level: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        (level - self.offset) / (255.0 * self.gain * self.passes(size, x, y))
    }

    /// The part of the light that reaches (x, y).
    fn passes(&self, size: (usize, usize), x: f64, y: f64) -> f64 {
        let [u, v] = place(size, x, y);
        let [u, v] = [u - self.brightest[0], v - self.brightest[1]];
        1.0 - self.fall_off * (u * u + v * v)
    }

    pub fn record(&self, light: Vec3, size: (usize, usize), x: usize, y: usize) -> [u8; 3] {
        [0, 1, 2].map(|c| {
            let bytes = hash([x as u32, y as u32, c as u32, self.seed]).to_le_bytes();
            // The sum of four uniform bytes is close to normal: mean 510, standard deviation 147.8.
            let normal = (bytes.map(f64::from).iter().sum::<f64>() - 510.0) / 147.8;
            let level = self.level(light[c], size, x as f64, y as f64) + self.noise * normal;
            (level + 0.5).clamp(0.0, 255.0) as u8
        })
    }
}
