// The labels that each pixel has.

#import volume

// The label window of the pixel at (x, y): first label | number of labels with padding << 16.
fn window_of(x: u32, y: u32) -> u32 {
    return windows[params.level.windows_at + y / 2u * ((params.level.width + WINDOW_RUN - 1u) / WINDOW_RUN) + x / WINDOW_RUN];
}

// Which entries of a quad are labels in this window.
fn are_in(window: u32, quad: u32) -> vec4<bool> {
    let first = window & 0xffffu;
    let labels = labels_of(quad);
    return (labels >= vec4(first)) & (labels < vec4(min(first + (window >> 16u), params.level.labels)));
}
