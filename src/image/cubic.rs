//! Interpolation by cubics (Keys 1981, Catmull and Rom), in integers.

/// Positions are in 1/256 px.
pub(crate) const STEPS: i64 = 256;
/// The weights of one direction sum to this power of 2.
pub(crate) const BITS: u32 = 14;

/// The weights of the pixels -1, 0, 1 and 2 for every position between 0 and 1: the exact cubic of Catmull
/// and Rom, rounded.
pub(crate) const WEIGHTS: [[i32; 4]; STEPS as usize] = {
    let mut all = [[0; 4]; STEPS as usize];
    let mut i = 0;
    while i < STEPS {
        let (i1, i2, i3) = (i * STEPS * STEPS, i * i * STEPS, i * i * i);
        // In units of 2^-25.
        let exact =
            [2 * i2 - i3 - i1, 3 * i3 - 5 * i2 + 2 * STEPS * STEPS * STEPS, 4 * i2 - 3 * i3 + i1, i3 - i2];
        let mut weights = [0; 4];
        let (mut tap, mut sum) = (0, 0);
        while tap < 4 {
            weights[tap] = ((exact[tap] + (1 << 10)) >> 11) as i32;
            sum += weights[tap];
            tap += 1;
        }
        // The rounding error goes to the largest weight.
        weights[if 2 * i <= STEPS { 1 } else { 2 }] += (1 << BITS) - sum;
        all[i as usize] = weights;
        i += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_add_up_and_mirror() {
        for (i, weights) in WEIGHTS.iter().enumerate() {
            assert_eq!(weights.iter().sum::<i32>(), 1 << BITS);
            let t = i as f64 / 256.0;
            let exact = [
                -t * t * t + 2.0 * t * t - t,
                3.0 * t * t * t - 5.0 * t * t + 2.0,
                -3.0 * t * t * t + 4.0 * t * t + t,
                t * t * t - t * t,
            ];
            for (weight, exact) in weights.iter().zip(exact) {
                assert!((f64::from(*weight) - exact * 8192.0).abs() <= 2.0, "{i}: {weights:?}");
            }
        }
        assert_eq!(WEIGHTS[0], [0, 1 << BITS, 0, 0]);
    }
}
