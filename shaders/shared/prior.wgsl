// Priors. A prior is: first label without a cost | slope << 20, last label without a cost | cap << 20.

#import volume

// The cost of four labels.
fn prior_cost(known: vec2<u32>, quad: u32) -> vec4<u32> {
    let at = (labels_of(quad) + vec4(1u)) << vec4(PRIOR_LABEL_BITS);
    let low = vec4(known.x & 0xfffffu);
    let high = vec4(known.y & 0xfffffu);
    let away = min(max(max(low, at) - at, max(at, high) - high), vec4(PRIOR_REACH));
    let cost = (vec4(known.x >> 20u) * away) >> vec4(PRIOR_LABEL_BITS + PRIOR_SLOPE_BITS);
    return min(cost, vec4(prior_cap(known)));
}

// The largest cost; 0 where nothing is known.
fn prior_cap(known: vec2<u32>) -> u32 {
    return known.y >> 20u;
}
