// Shows both views: as an anaglyph, or alternating.

import type { Picture } from './protocol';

/** Frames of a wiggle per second. */
const FRAMES = 5;

/** The right view shifted so that points with this disparity coincide with the left view. */
export function aligned({ width, height, pixels }: Picture, disparity: number): Picture {
    const by = Math.round(disparity);
    const moved = new Uint8ClampedArray(pixels.length);
    for (let y = 0; y < height; y += 1) {
        // Columns of the row that have a source.
        const [first, last] = [Math.max(0, by), Math.min(width, width + by)];
        if (first < last) {
            const row = 4 * y * width;
            moved.set(pixels.subarray(row + 4 * (first - by), row + 4 * (last - by)), row + 4 * first);
        }
    }
    return { width, height, pixels: moved };
}

/** An anaglyph for red-cyan glasses; the left view is grey to reduce retinal rivalry. */
export function anaglyph(left: Picture, right: Picture): Picture {
    const pixels = new Uint8ClampedArray(right.pixels);
    for (let i = 0; i < pixels.length; i += 4) {
        const [r, g, b] = left.pixels.subarray(i, i + 3) as unknown as [number, number, number];
        pixels[i] = 0.299 * r + 0.587 * g + 0.114 * b;
        pixels[i + 3] = 255;
    }
    return { width: left.width, height: left.height, pixels };
}

/** Shows pictures in turn, repeatedly. */
export class Wiggle {
    private timer: ReturnType<typeof setInterval> | undefined;

    /** Starts with these pictures. */
    start(pictures: Picture[], show: (picture: Picture) => void): void {
        this.stop();
        let at = 0;
        this.timer = setInterval(() => {
            at = (at + 1) % pictures.length;
            const picture = pictures[at];
            if (picture) {
                show(picture);
            }
        }, 1000 / FRAMES);
    }

    stop(): void {
        clearInterval(this.timer);
        this.timer = undefined;
    }
}
