// Checks that a pair fits into the memory of WebAssembly before it is read.

import { count, size } from './dom';

/** The address space of 32-bit WebAssembly. */
const LIMIT = 2 ** 32;

/** Least bytes per pixel of a match: both decoded views, the maps, and the page's copies. */
const PER_PIXEL = 64;

/** Why a pair of this size is too large; undefined if it may fit. */
export function tooLarge(width: number, height: number, files: number): string | undefined {
    const least = width * height * PER_PIXEL + files;
    return least > LIMIT
        ? `Views of ${count(width)} × ${count(height)} pixels take ${size(least)} at least, and a page can use ${size(LIMIT)}. Scale them down, or use the program: it matches in tiles.`
        : undefined;
}
