// Maps as pictures, where the engine has no longer what they are of.

import type { Picture, Range } from './protocol';

/** Disparities in the colours of a scale of 256 entries, RGB, from its least to its largest; black where there is none. */
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
