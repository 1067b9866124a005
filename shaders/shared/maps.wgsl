// Disparities are in 1/256 px. Flags have the validity in the lower 8 bits and the confidence in the next 8.

fn is_valid(flags: u32) -> bool {
    return (flags & INVALID) == 0u;
}

// Whether the pixel is filled from the pixels around it; one that a prior decided is not.
fn is_filled(flags: u32) -> bool {
    return (flags & INVALID) != 0u && (flags & FILLED) != 0u;
}

fn has_disparity(flags: u32) -> bool {
    return (flags & INVALID) == 0u || (flags & FILLED) != 0u;
}
