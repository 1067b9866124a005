// Tests the npm package as users install it: in fresh projects, in Node.js and in Chromium, with and without Vite.
//
//   node web/npm/tests/try.mjs TARBALL   MRFGS names the program to compare with
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { transformSync } from 'esbuild';
import { installed, launch } from '../../tests/lib/browser.mjs';
import { difference, native } from '../../tests/lib/native.mjs';
import { ROOT, scene } from '../../tests/lib/paths.mjs';
import { serve } from '../../tests/lib/server.mjs';

const VITE = '8.3.8';
// Standard output is reserved for the line in the table of scripts/release.
const TOLD = ['ignore', 2, 2];
const tarball = resolve(process.argv[2]);
const folder = mkdtempSync(join(tmpdir(), 'mrfgs-npm-'));

function project(name, ...packages) {
    const at = join(folder, name);
    mkdirSync(at);
    writeFileSync(join(at, 'package.json'), JSON.stringify({ name, private: true, type: 'module' }));
    execFileSync('npm', ['install', '--no-audit', '--no-fund', '--silent', tarball, ...packages], { cwd: at, stdio: TOLD });
    return at;
}

function inNode() {
    const at = project('node');
    cpSync(join(ROOT, 'web/npm/tests/node.mjs'), join(at, 'node.test.mjs'));
    const env = { ...process.env, MRFGS_ROOT: ROOT };
    execFileSync(process.execPath, ['--test', '--test-reporter=spec', 'node.test.mjs'], { cwd: at, stdio: TOLD, env });
}

/** Tests in Chromium: built by Vite, from its development server, and without a bundler. Returns whether there is a Chromium. */
async function byVite() {
    const at = project('vite', `vite@${VITE}`);
    cpSync(join(ROOT, 'web/npm/tests/vite'), at, { recursive: true });
    cpSync(scene('mixed'), join(at, 'public/scene'), { recursive: true });
    execFileSync(join(ROOT, 'web/node_modules/.bin/tsc'), ['--project', at], { stdio: TOLD });
    execFileSync('npx', ['vite', 'build', '--base', './', '--logLevel', 'warn'], { cwd: at, stdio: TOLD });
    if (!installed('chromium')) {
        return false;
    }
    const { createServer } = await import(pathToFileURL(join(at, 'node_modules/vite/dist/node/index.js')).href);
    const development = await createServer({ root: at, logLevel: 'warn', optimizeDeps: { exclude: ['@mrfgs/wasm'] }, server: { host: '127.0.0.1' } });
    await development.listen();
    // Removes the types from the page, and refers to the package by its URL.
    const script = readFileSync(join(at, 'main.ts'), 'utf8');
    const bare = join(at, 'bare');
    mkdirSync(bare);
    cpSync(join(at, 'public'), bare, { recursive: true });
    cpSync(join(at, 'node_modules/@mrfgs/wasm'), join(bare, 'wasm'), { recursive: true });
    writeFileSync(join(bare, 'main.js'), transformSync(script.replace("'@mrfgs/wasm'", "'./wasm/index.js'"), { loader: 'ts' }).code);
    writeFileSync(join(bare, 'index.html'), '<!doctype html><script type="module" src="main.js"></script>');
    const host = await serve({ '/built/': join(at, 'dist'), '/bare/': bare });
    const open = { true: await launch('chromium'), false: await launch('chromium', { gpu: false }) };
    try {
        const { pfm } = native(join(scene('mixed'), 'im0.png'), join(scene('mixed'), 'im1.png'), ['--max-disparity', '47']);
        const pages = [
            { page: `${host.url}/built/`, device: 'webgpu' },
            { page: `${host.url}/built/`, device: 'cpu' },
            { page: `${host.url}/built/`, device: 'auto', gpu: false, note: /WebGPU|GPU/ },
            { page: development.resolvedUrls.local[0], device: 'cpu' },
            { page: `${host.url}/bare/`, device: 'cpu' },
        ];
        for (const { page, device, gpu = true, note = /^$/ } of pages) {
            const tab = await open[gpu].newPage();
            tab.on('pageerror', (error) => console.error(error.message));
            await tab.goto(page);
            await tab.waitForFunction(() => document.title === 'ready');
            const found = await tab.evaluate((device) => window.match(device), device);
            assert.match(found.note ?? '', note);
            assert.equal(difference(upsideDown(Buffer.from(found.disparity), 320), pfm.subarray(-4 * 320 * 240)), undefined, `another map by ${device} on ${page}`);
            console.error(`in Chromium on ${found.device}, ${page}: the map of the program`);
            if (!gpu) {
                await assert.rejects(tab.evaluate(() => window.match('webgpu')), /GPU/);
            }
            await tab.close();
        }
    } finally {
        await open.true.close();
        await open.false.close();
        await host.stop();
        await development.close();
    }
    return true;
}

/** Reverses the rows, as PFM stores the last row first. */
function upsideDown(map, width) {
    const rows = Array.from({ length: map.length / (4 * width) }, (_, y) => map.subarray(4 * width * y, 4 * width * (y + 1)));
    return Buffer.concat(rows.reverse());
}

try {
    inNode();
    const chromium = await byVite();
    const { version } = JSON.parse(readFileSync(join(folder, 'vite/node_modules/vite/package.json')));
    console.log(`the program's map in Node.js ${process.versions.node}; built by Vite ${version}${chromium ? ', and the same map in Chromium' : ''}`);
    if (!chromium) {
        console.error('SKIPPED: the package in Chromium, as it is not installed');
    }
} finally {
    rmSync(folder, { recursive: true, force: true });
}
