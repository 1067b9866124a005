// Colours maps in the page, when the engine no longer holds them.

import type { Picture, Range } from './protocol';

/** Applies a colour scale of 256 RGB entries to disparities; missing ones are black. */
export function painted(width: number, height: number, disparity: Float32Array, scale: Uint8Array, { min, max }: Range): Picture {
    const pixels = new Uint8ClampedArray(4 * disparity.length);
    disparity.forEach((value, i) => {
        pixels[4 * i + 3] = 255;
        if (Number.isFinite(value)) {
            const at = Math.round((255 * (Math.min(Math.max(value, min), max) - min)) / Math.max(1e-6, max - min));
            pixels.set(scale.subarray(3 * at, 3 * at + 3), 4 * i);
        }
    });
    return { width, height, pixels };
}
