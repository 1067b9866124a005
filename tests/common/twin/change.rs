/// Label index of each pixel: the smallest belief, the lowest on ties.
pub fn labels(belief: &[u32], labels: usize) -> Vec<i64> {
    belief
        .chunks(labels)
        .map(|b| {
            let mut best = 0;
            for d in 1..labels {
                if b[d] < b[best] {
                    best = d;
                }
            }
            best as i64
        })
        .collect()
}

/// Replaces `map` by the label map of these beliefs; returns the sum of squared differences.
pub fn change(belief: &[u32], label_count: usize, map: &mut Vec<i64>) -> u64 {
    let new = labels(belief, label_count);
    let sum: i64 = new.iter().zip(map.iter()).map(|(a, b)| (a - b) * (a - b)).sum();
    *map = new;
    u64::try_from(sum).unwrap()
}
