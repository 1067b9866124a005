// Compares the engine in a browser with the native program, bit for bit:
//
//   node web/tests/parity.mjs chromium|firefox PAIRDIR... [--presets default,paper,fgs,fast] [--paths gpu,cpu] [--flip]
//
// A pair is a folder with im0.png and im1.png; its calib.txt gives the range (ndisp), as for `mrfgs match`. Needs target/web/engine, built by
// scripts/web, and target/release/mrfgs. Prints one line of JSON per path and preset: the number of pixels in all pairs, the number that
// differ in any of the four maps (disparity, raw, confidence, validity), and the seconds in the browser. The exit status is 1 if pixels
// differ. --flip flips one bit of the first result, which must be counted as one pixel.
import { basename, dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { levels } from '../png.mjs';
import { installed, launch } from './lib/browser.mjs';
import { native } from './lib/native.mjs';
import { ENGINE } from './lib/paths.mjs';
import { serve } from './lib/server.mjs';

const { values: options, positionals } = parseArgs({
    allowPositionals: true,
    options: {
        presets: { type: 'string', default: 'default,paper,fgs,fast' },
        paths: { type: 'string', default: 'gpu,cpu' },
        flip: { type: 'boolean', default: false },
    },
});
const [name, ...folders] = positionals.map((value, i) => (i === 0 ? value : resolve(value)));
if (!['chromium', 'firefox'].includes(name) || folders.length === 0) {
    console.error('usage: node web/tests/parity.mjs chromium|firefox PAIRDIR... [--presets LIST] [--paths LIST] [--flip]');
    process.exit(2);
}
if (!installed(name)) {
    console.error(`parity: ${name} is not installed; its path may be in the variable ${name.toUpperCase()}`);
    process.exit(1);
}

const OUTPUTS = ['pfm', 'raw', 'confidence', 'validity'];

/** The bytes of each pixel of a map, independent of the file format. */
function pixels(output, file) {
    if (output === 'confidence' || output === 'validity') {
        const { width, height, levels: data } = levels(file);
        return { width, height, bytes: 1, data };
    }
    const [head, width, height] = file.toString('latin1', 0, 64).match(/^Pf\n(\d+) (\d+)\n[^\n]*\n/);
    return { width: Number(width), height: Number(height), bytes: 4, data: file.subarray(head.length) };
}

/** Number of pixels that differ in any of the outputs. */
function differing(found, expected) {
    const differs = new Set();
    for (const output of OUTPUTS) {
        if (Buffer.compare(found[output], expected[output]) === 0) {
            continue;
        }
        const [a, b] = [pixels(output, found[output]), pixels(output, expected[output])];
        if (a.width !== b.width || a.height !== b.height || a.data.length !== b.data.length) {
            throw new Error(`${output} is ${a.width} x ${a.height} in place of ${b.width} x ${b.height}`);
        }
        const before = differs.size;
        for (let i = 0; i < a.data.length; i += 1) {
            if (a.data[i] !== b.data[i]) {
                const at = Math.floor(i / a.bytes);
                // PFM stores the bottom row first, PNG the top row.
                const row = Math.floor(at / a.width);
                differs.add(a.bytes === 4 ? (a.height - 1 - row) * a.width + (at % a.width) : at);
            }
        }
        if (differs.size === before && before === 0) {
            throw new Error(`the files of ${output} differ, their pixels do not`);
        }
    }
    return differs.size;
}

// Results come back by POST, as the text-based protocol of the browser would take longer than a match.
const results = new Map();
const receive = (request, response, key) => {
    const parts = [];
    request.on('data', (part) => parts.push(part));
    request.on('end', () => {
        results.set(key, Buffer.concat(parts));
        response.writeHead(204).end();
    });
};
const here = dirname(fileURLToPath(import.meta.url));
const mounts = { '/engine/': ENGINE, '/tests/': here, '/results/': receive };
folders.forEach((folder, i) => (mounts[`/pairs/${i}/`] = folder));
const host = await serve(mounts);
const browser = await launch(name);
let failed = false;
try {
    const version = (await browser.version()).replace(/^(Headless)?/, '');
    const page = await browser.newPage();
    page.on('pageerror', (error) => console.error(`parity: ${error.message}`));
    await page.goto(`${host.url}/tests/parity.html`);
    let flip = options.flip;
    for (const path of options.paths.split(',')) {
        for (const preset of options.presets.split(',')) {
            const line = { driver: '', version, path, preset, pairs: folders.length, pixels: 0, differing: 0, seconds: 0 };
            for (const [i, folder] of folders.entries()) {
                const views = ['im0.png', 'im1.png'].map((file) => join(folder, file));
                const expected = native(...views, ['--method', preset]);
                const said = await page.evaluate((job) => window.match(job), { path, preset, pair: i, range: expected.range });
                if (said.error) {
                    throw new Error(`${basename(folder)}, ${preset}, ${path}: ${said.error}`);
                }
                if (said.note || (path === 'gpu') !== /WebGPU/.test(said.device)) {
                    throw new Error(`${basename(folder)}, ${preset}, ${path}: ran on ${said.device}. ${said.note ?? ''}`);
                }
                const found = Object.fromEntries(OUTPUTS.map((output) => [output, results.get(output)]));
                if (flip) {
                    found.pfm[found.pfm.length - 4 * 1000] ^= 1;
                    flip = false;
                }
                line.driver = said.device;
                line.pixels += said.width * said.height;
                line.seconds += said.seconds;
                line.differing += differing(found, expected);
            }
            failed ||= line.differing > 0;
            line.seconds = Number(line.seconds.toFixed(2));
            console.log(JSON.stringify(line));
        }
    }
} catch (error) {
    console.error(`parity: ${error.message}`);
    failed = true;
} finally {
    await browser.close();
    await host.stop();
}
process.exit(failed ? 1 : 0);
