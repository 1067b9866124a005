// The range of disparities that the colours cover.

import type { Range } from './protocol';

/** Share of the measured pixels beyond either end of the colours. */
const OUTSIDE = 0.01;

/** The range of nearly all measured disparities, to use all colours; falls back to the `searched` range. */
export function spread(disparity: Float32Array, validity: Uint8Array, searched: Range): Range {
    const every = Math.max(1, Math.floor(disparity.length / 200_000));
    const some: number[] = [];
    for (let i = 0; i < disparity.length; i += every) {
        const value = disparity[i] ?? Infinity;
        if (validity[i] === 0 && Number.isFinite(value)) {
            some.push(value);
        }
    }
    some.sort((a, b) => a - b);
    const at = (part: number) => some[Math.round(part * (some.length - 1))] ?? NaN;
    const [min, max] = [at(OUTSIDE), at(1 - OUTSIDE)];
    return max - min >= 1 ? { min, max } : searched;
}
