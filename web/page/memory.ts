// Whether a pair fits into what WebAssembly can address, before anything is read.

import { count, size } from './dom';

/** All that a WebAssembly module of 32 bits can hold. */
const LIMIT = 2 ** 32;

/** Bytes that a match takes per pixel at least: both views decoded, the maps, and their copies for the page. */
const PER_PIXEL = 64;

/** Why a pair of this size is too large; undefined where it may fit. */
export function tooLarge(width: number, height: number, files: number): string | undefined {
    const least = width * height * PER_PIXEL + files;
    return least > LIMIT
        ? `Views of ${count(width)} × ${count(height)} pixels take ${size(least)} at least, and a page can use ${size(LIMIT)}. Scale them down, or use the program: it matches in tiles.`
        : undefined;
}
