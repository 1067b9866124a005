//! Parts of a list or of a pair, for several machines or jobs.

use crate::text::fnv1a;

/// Part `index` of `count`, from 0.
#[derive(Clone, Copy)]
pub(crate) struct Shard {
    index: u64,
    count: u64,
}

/// # Errors
/// A message with the accepted form, for anything but K/N.
pub(crate) fn shard(text: &str) -> Result<Shard, String> {
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse::<u32>().ok()?)));
    match numbers {
        Some((k, n)) if (1..=n).contains(&k) => Ok(Shard { index: u64::from(k - 1), count: u64::from(n) }),
        _ => Err("give K/N with K from 1 to N, such as 2/8".into()),
    }
}

impl Shard {
    /// Whether block `index` of a pair, from 0, is in this part.
    pub(crate) fn holds_block(self, index: usize) -> bool {
        index as u64 % self.count == self.index
    }

    /// Whether the pair `name` is in this part.
    pub(crate) fn holds(self, name: &str) -> bool {
        let hash = fnv1a(name);
        (hash >> 32 ^ hash & 0xffff_ffff) % self.count == self.index
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_in_one_shard_and_stays_there() {
        for count in [1, 2, 3, 8, 64] {
            let mut sizes = vec![0; count as usize];
            for pair in 0..1000 {
                let name = format!("pair-{pair:04}");
                let held: Vec<_> = (0..count).filter(|&index| Shard { index, count }.holds(&name)).collect();
                assert_eq!(held.len(), 1, "{name}");
                sizes[held[0] as usize] += 1;
            }
            let even = 1000 / count;
            assert!(sizes.iter().all(|size| (even / 3..=even * 3).contains(size)), "{sizes:?}");
        }
        // The published FNV-1a values of "a" and "foobar", folded: the part of a pair must never change between releases.
        for (name, hash) in [("a", 0xaf63_dc4c_8601_ec8c_u64), ("foobar", 0x8594_4171_f739_67e8)] {
            let (index, count) = ((hash >> 32 ^ hash & 0xffff_ffff) % 1009, 1009);
            assert!(Shard { index, count }.holds(name), "{name}");
        }
    }

    #[test]
    fn every_block_is_in_one_shard() {
        for count in [1, 2, 3, 8, 64] {
            let held =
                |block: usize| (0..count).filter(|&index| Shard { index, count }.holds_block(block)).count();
            assert!((0..100).all(|block| held(block) == 1), "{count}");
        }
    }

    #[test]
    fn a_shard_is_one_of_some() {
        for text in ["0/3", "4/3", "1/0", "-1/3", "1", "1/", "/3", "a/b", "1/2/3", "1/99999999999"] {
            assert!(shard(text).is_err(), "{text}");
        }
        assert!(shard("3/3").is_ok_and(|shard| (shard.index, shard.count) == (2, 3)));
    }
}
