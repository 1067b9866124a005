// Builds the page into target/web/site: scripts/web calls this where the engine lies in target/web/engine.
import { createHash } from 'node:crypto';
import { copyFileSync, mkdirSync, readFileSync, readdirSync, renameSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { basename, dirname, join, relative } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { build } from 'esbuild';
import { shrunk } from './png.mjs';

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const engine = join(root, 'target/web/engine');
const site = join(root, 'target/web/site');
// Whole or not at all.
const out = `${site}.new`;

const SCENES = [
    { name: 'mixed', title: 'Still life' },
    { name: 'slanted', title: 'Slanted' },
    { name: 'thin', title: 'Thin' },
    { name: 'steep', title: 'Steep' },
];

/** Eight characters that stand for the content, as esbuild has them in its names. */
const digest = (content) => createHash('sha256').update(content).digest('hex').slice(0, 8).toUpperCase();

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });

const wasm = readFileSync(join(engine, 'mrfgs_web_bg.wasm'));
const wasmName = `engine-${digest(wasm)}.wasm`;
writeFileSync(join(out, wasmName), wasm);

/** Bundles; answers with the name that an entry has got. */
async function bundle(entries, options) {
    const { metafile } = await build({
        entryPoints: entries.map((entry) => join(root, 'web/page', entry)),
        outdir: out,
        bundle: true,
        minify: true,
        format: 'esm',
        target: ['chrome113', 'firefox115', 'safari16.4'],
        entryNames: '[name]-[hash]',
        chunkNames: '[name]-[hash]',
        legalComments: 'none',
        metafile: true,
        logLevel: 'warning',
        absWorkingDir: root,
        ...options,
    });
    const named = Object.entries(metafile.outputs).filter(([, { entryPoint }]) => entryPoint);
    return (entry) => basename(named.find(([, { entryPoint }]) => basename(entryPoint) === entry)[0]);
}

const worker = await bundle(['worker.ts'], {
    alias: { engine: join(engine, 'mrfgs_web.js') },
    define: { ENGINE: JSON.stringify(wasmName) },
});
const page = await bundle(['page.ts', 'style.css'], {
    splitting: true,
    define: { WORKER: JSON.stringify(worker('worker.ts')), SCENES: JSON.stringify(SCENES) },
});

const names = { page: page('page.ts'), style: page('style.css') };
const html = readFileSync(join(root, 'web/page/index.html'), 'utf8').replace(/\{\{(\w+)\}\}/g, (_, name) => names[name]);
writeFileSync(join(out, 'index.html'), html);
copyFileSync(join(root, 'web/page/icon.svg'), join(out, 'icon.svg'));
// Licences of what the files hold besides this project's own.
copyFileSync(join(root, 'web/node_modules/three/LICENSE'), join(out, 'three-LICENSE.txt'));

for (const { name } of SCENES) {
    const [from, to] = [join(root, 'testdata', name), join(out, 'scenes', name)];
    mkdirSync(to, { recursive: true });
    for (const file of ['im0.png', 'im1.png', 'calib.txt']) {
        copyFileSync(join(from, file), join(to, file));
    }
    writeFileSync(join(to, 'small.png'), shrunk(readFileSync(join(from, 'im0.png')), 120, 90));
}

/** All files below a folder, by their paths from it. */
const files = (folder) =>
    readdirSync(folder, { recursive: true, withFileTypes: true })
        .filter((entry) => entry.isFile())
        .map((entry) => relative(folder, join(entry.parentPath ?? entry.path, entry.name)))
        .sort();

// All but the views of the scenes, which are kept once they were opened.
const kept = files(out).filter((file) => !/\/(im[01]\.png|calib\.txt)$|LICENSE/.test(file));
const all = createHash('sha256');
for (const file of kept) {
    all.update(`${file}\n`).update(readFileSync(join(out, file)));
}
await bundle(['service-worker.ts'], {
    entryNames: '[name]',
    format: 'iife',
    define: {
        FILES: JSON.stringify(kept.map((file) => (file === 'index.html' ? './' : file))),
        DIGEST: JSON.stringify(all.digest('hex').slice(0, 16)),
    },
});

rmSync(site, { recursive: true, force: true });
renameSync(out, site);

const visited = files(site).filter((file) => !/\/(im[01]\.png|calib\.txt)$|LICENSE/.test(file));
const sizes = visited.map((file) => [file, statSync(join(site, file)).size, gzipSync(readFileSync(join(site, file)), { level: 9 }).length]);
const sum = (column) => sizes.reduce((total, row) => total + row[column], 0);
sizes.sort((a, b) => b[2] - a[2]);
sizes.push(['what a visitor loads', sum(1), sum(2)]);
const rest = files(site).filter((file) => !visited.includes(file));
sizes.push(['views of the scenes, when opened', ...[0, 0].map(() => rest.reduce((total, file) => total + statSync(join(site, file)).size, 0))]);
console.log(`${'file'.padEnd(36)}${'bytes'.padStart(11)}${'gzip -9'.padStart(11)}`);
for (const [file, raw, packed] of sizes) {
    console.log(`${file.padEnd(36)}${raw.toLocaleString('en').padStart(11)}${packed.toLocaleString('en').padStart(11)}`);
}
