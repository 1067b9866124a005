// The labels that each pixel has. All others have infinite beliefs once the level has joined; stages skip them.

#import volume

// Index of the window of the pixel at (x, y) of a level: first label | number of labels with padding << 16.
fn window_place(level: Level, x: u32, y: u32) -> u32 {
    return level.windows_at + y / 2u * ((level.width + WINDOW_RUN - 1u) / WINDOW_RUN) + x / WINDOW_RUN;
}

// The window of a pixel of the stage's level.
fn window_of(x: u32, y: u32) -> u32 {
    return windows[window_place(params.level, x, y)];
}

// (first label, last label + 1) of a window.
fn ends(window: u32) -> vec2<u32> {
    let first = window & 0xffffu;
    return vec2(first, first + (window >> 16u));
}

// (first quad, last quad + 1) of a window; windows are whole quads.
fn quads_of(window: u32) -> vec2<u32> {
    return ends(window) / 4u;
}

// Which entries of a quad are labels in this window.
fn are_in(window: u32, quad: u32) -> vec4<bool> {
    let labels = labels_of(quad);
    return (labels >= vec4(window & 0xffffu)) & (labels < vec4(min(ends(window).y, params.level.labels)));
}
