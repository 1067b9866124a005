// Shades a map with light from the upper left, so that small steps become visible.

import type { Picture, Range } from './protocol';

/** Limits of the shading. */
const DARKEST = 0.55;
const LIGHTEST = 1.3;

/** Shades the picture of a map by the slope of the disparity relative to the `spread`. */
export function lit({ width, height, pixels }: Picture, disparity: Float32Array, { min, max }: Range): Picture {
    const lit = new Uint8ClampedArray(pixels);
    // A step of 1/40 of the range per pixel has the strongest shading.
    const strength = 40 / Math.max(1, max - min);
    const at = (x: number, y: number) => disparity[Math.min(y, height - 1) * width + Math.min(x, width - 1)] ?? Infinity;
    for (let y = 0; y < height; y += 1) {
        for (let x = 0; x < width; x += 1) {
            const slope = 2 * at(x, y) - at(x + 1, y) - at(x, y + 1);
            if (Number.isFinite(slope)) {
                const light = Math.min(Math.max(1 - 0.4 * strength * slope, DARKEST), LIGHTEST);
                for (let i = 4 * (y * width + x), end = i + 3; i < end; i += 1) {
                    lit[i] = (pixels[i] ?? 0) * light;
                }
            }
        }
    }
    return { width, height, pixels: lit };
}
