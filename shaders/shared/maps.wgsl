// Disparities are in 1/256 px. Flags hold the validity in the lower 8 bits and the confidence in the next 8.

const FRACTION: i32 = 256;

const OUTSIDE: u32 = 1u;
const OCCLUDED: u32 = 2u;
const SPECKLE: u32 = 4u;
const LOW_CONFIDENCE: u32 = 8u;
const FILLED: u32 = 16u;
const MASKED: u32 = 32u;
const INVALID: u32 = OUTSIDE | OCCLUDED | SPECKLE | MASKED;
const VALIDITY: u32 = 0xffu;

fn is_valid(flags: u32) -> bool {
    return (flags & INVALID) == 0u;
}

fn has_disparity(flags: u32) -> bool {
    return (flags & INVALID) == 0u || (flags & FILLED) != 0u;
}
