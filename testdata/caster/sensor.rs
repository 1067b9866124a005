//! Camera sensors.

use super::noise::hash;
use super::vector::Vec3;

/// Position of the image point (x, y) relative to the centre, in image heights.
pub fn place((width, height): (usize, usize), x: f64, y: f64) -> [f64; 2] {
    let scale = height as f64;
    [(x - middle(width)) / scale, (y - middle(height)) / scale]
}

pub fn middle(pixels: usize) -> f64 {
    0.5 * (pixels - 1) as f64
}

/// Converts light (1 is white) to bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    pub gain: f64,
    /// Fraction of the light lost one image height away from `brightest`; it grows with the square of the distance.
    pub fall_off: f64,
    /// Image position without vignetting, in image heights from the centre.
    pub brightest: [f64; 2],
    /// Added after the gain, in grey levels.
    pub offset: f64,
    /// Standard deviation of the noise, in grey levels.
    pub noise: f64,
    /// Vertical misalignment: how much lower everything is recorded, in pixels.
    pub lower: f64,
    /// Side of the square from which a pixel collects light, in pixels: 1 in focus, more when out of focus.
    pub spread: f64,
    seed: u32,
}

impl Sensor {
    /// A sensor in focus with a little noise and no vignetting.
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

    /// The grey level for light at (x, y) in an image of this size, without noise.
    pub fn level(&self, light: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        255.0 * self.gain * light * self.passes(size, x, y) + self.offset
    }

    /// The light for a grey level at (x, y): the inverse of [`Self::level`].
    pub fn light(&self, level: f64, size: (usize, usize), x: f64, y: f64) -> f64 {
        (level - self.offset) / (255.0 * self.gain * self.passes(size, x, y))
    }

    /// Fraction of the light that reaches (x, y).
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
