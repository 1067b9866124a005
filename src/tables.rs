//! Tables of exponentials in integers: the only transcendental function of the method, the same on every
//! machine because it is evaluated with IEEE additions, multiplications and divisions alone.

/// exp(-x) for x >= 0, by a Taylor series of exp(x / 2^k) and k squarings; to a relative 1e-11.
#[must_use]
pub fn exp_neg(x: f64) -> f64 {
    if x > 700.0 {
        return 0.0;
    }
    let mut reduced = x;
    let mut squarings = 0;
    while reduced > 0.125 {
        reduced /= 2.0;
        squarings += 1;
    }
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..=12 {
        term *= reduced / f64::from(n);
        sum += term;
    }
    for _ in 0..squarings {
        sum *= sum;
    }
    1.0 / sum
}

/// Cost units per unit of the AD-census cost: its range 0 to 2 takes 0 ..= 254.
pub const AD_CENSUS_UNITS: f64 = 127.0;
/// Entries of the colour table: |dr| + |dg| + |db| in 8-bit levels.
pub const AD_ENTRIES: usize = 768;
/// Entries of the census table: one more than the 62 comparisons of a 9 x 7 window.
pub const CENSUS_ENTRIES: usize = 63;

/// round(127 (1 - exp(-AD / 10))) for AD = index / 3 levels, each 0 ..= 127.
#[must_use]
pub fn ad_cost() -> Vec<u8> {
    (0..AD_ENTRIES)
        .map(|i| (AD_CENSUS_UNITS * (1.0 - exp_neg(i as f64 / 30.0)) + 0.5).floor() as u8)
        .collect()
}

/// round(127 (1 - exp(-Hamming / 30))), each 0 ..= 127.
#[must_use]
pub fn census_cost() -> Vec<u8> {
    (0..CENSUS_ENTRIES)
        .map(|h| (AD_CENSUS_UNITS * (1.0 - exp_neg(h as f64 / 30.0)) + 0.5).floor() as u8)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_agree_with_the_platform() {
        for i in 0..7000 {
            let x = f64::from(i) / 10.0;
            let (ours, libm) = (exp_neg(x), (-x).exp());
            assert!((ours - libm).abs() <= 1e-11 * libm, "exp(-{x}): {ours} against {libm}");
        }
        assert!(exp_neg(1e6) < f64::MIN_POSITIVE);
    }
}
