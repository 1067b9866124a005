//! Noise that is identical on every machine.

use super::vector::{Vec3, scale};

/// Noise with a standard deviation of about 1 in octaves from `cell` down to about two pixels, each `gain` times as strong as the one
/// before. Octaves fade with depth, and therefore alike in both views.
pub fn octaves(p: Vec3, cell: f64, pixel: f64, gain: f64, seed: u32) -> f64 {
    let (mut q, mut cell, mut weight) = (scale(p, 1.0 / cell), cell, 1.0);
    let (mut sum, mut power) = (0.0, 0.0);
    for octave in 0..12_u32 {
        let fade = (cell / pixel - 1.5).clamp(0.0, 1.0);
        if fade == 0.0 && octave > 0 {
            break;
        }
        let w = if octave == 0 { weight } else { weight * fade };
        sum += w * noise(q, seed.wrapping_add(octave.wrapping_mul(0x51ed_270b)));
        power += w * w;
        // Twice as fine, and rotated (3-4-5) so that the lattices do not line up.
        q = [1.6 * q[0] - 1.2 * q[1], 1.2 * q[0] + 1.6 * q[1], 2.0 * q[2]];
        cell *= 0.5;
        weight *= gain;
    }
    2.4 * sum / power.sqrt()
}

/// Value noise in -1 ..= 1: random values on the integer lattice, blended smoothly.
pub fn noise(p: Vec3, seed: u32) -> f64 {
    let cell = p.map(|c| c.floor() as i32);
    let part = [0, 1, 2].map(|i| p[i] - f64::from(cell[i]));
    let [u, v, w] = part.map(|f| f * f * (3.0 - 2.0 * f));
    let value = |dx: i32, dy: i32, dz: i32| {
        let corner = [cell[0] + dx, cell[1] + dy, cell[2] + dz].map(|c| c as u32);
        f64::from(hash([corner[0], corner[1], corner[2], seed])) * (2.0 / 4_294_967_295.0) - 1.0
    };
    let blend = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let layer = |dz| {
        let top = blend(value(0, 0, dz), value(1, 0, dz), u);
        let bottom = blend(value(0, 1, dz), value(1, 1, dz), u);
        blend(top, bottom, v)
    };
    if w == 0.0 { layer(0) } else { blend(layer(0), layer(1), w) }
}

/// A pseudo-random word for each input.
pub fn hash([a, b, c, d]: [u32; 4]) -> u32 {
    let mut h = a.wrapping_mul(0x9e37_79b1);
    h = h.wrapping_add(b.wrapping_mul(0x85eb_ca77)).wrapping_add(c.wrapping_mul(0xc2b2_ae3d));
    h = h.wrapping_add(d.wrapping_mul(0x27d4_eb2f)).wrapping_add(0x1656_67b1);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}
