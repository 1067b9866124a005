// The output of the program for a pair, which every browser must reproduce.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { ROOT } from './paths.mjs';

/** The program; the variable MRFGS names another build. */
export const PROGRAM = process.env.MRFGS ?? join(ROOT, 'target/release/mrfgs');

/** Runs `mrfgs match` on the CPU, without `right` if the file `left` holds both views, and returns the bytes of the map and of the outputs in `also`. */
export function native(left, right, flags = [], also = ['raw', 'confidence', 'validity']) {
    const folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
    try {
        const json = join(folder, 'run.json');
        const output = ['--also', also.join(','), '--json', json, '--device', 'cpu', '--quiet'];
        execFileSync(PROGRAM, ['match', ...[left, right].filter(Boolean), join(folder, 'd.pfm'), ...output, ...flags]);
        const ends = { raw: 'raw.pfm', confidence: 'confidence.png', validity: 'validity.png', points: 'points.ply' };
        const files = also.map((word) => [word, readFileSync(join(folder, `d.${ends[word]}`))]);
        const { range } = JSON.parse(readFileSync(json, 'utf8'));
        return { pfm: readFileSync(join(folder, 'd.pfm')), range, ...Object.fromEntries(files) };
    } finally {
        rmSync(folder, { recursive: true, force: true });
    }
}

/** The offset of the first byte that differs; undefined if the files are equal. */
export function difference(a, b) {
    if (Buffer.compare(a, b) === 0) {
        return undefined;
    }
    const length = Math.min(a.length, b.length);
    for (let i = 0; i < length; i += 1) {
        if (a[i] !== b[i]) {
            return i;
        }
    }
    return length;
}
