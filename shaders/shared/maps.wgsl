// Disparities are in 1/256 px. Flags have the validity in the lower 8 bits and the confidence in the next 8.

fn is_valid(flags: u32) -> bool {
    return (flags & INVALID) == 0u;
}

fn has_disparity(flags: u32) -> bool {
    return (flags & INVALID) == 0u || (flags & FILLED) != 0u;
}
