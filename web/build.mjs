// Builds the page into target/web/site. Called by scripts/web after it has built the engine in target/web/engine.
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
// Replaces the site only when it is complete.
const out = `${site}.new`;

const SCENES = [
    { name: 'mixed', title: 'Still life' },
    { name: 'slanted', title: 'Slanted' },
    { name: 'thin', title: 'Thin' },
    { name: 'steep', title: 'Steep' },
];

/** A content hash of eight characters, as in the file names of esbuild. */
const digest = (content) => createHash('sha256').update(content).digest('hex').slice(0, 8).toUpperCase();

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });

const wasm = readFileSync(join(engine, 'mrfgs_web_bg.wasm'));
const wasmName = `engine-${digest(wasm)}.wasm`;
writeFileSync(join(out, wasmName), wasm);

/** Bundles the entries and returns a function from an entry to its output name. */
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
/** Links to the source and the guide, if the repository has an address. */
const source = readFileSync(join(root, 'Cargo.toml'), 'utf8').match(/^repository = "(.*)"$/m)?.[1];
names.links = source ? `    <a href="${source}">Source</a>\n    <a href="${source}/tree/main/docs/guide">Guide</a>\n` : '';
const html = readFileSync(join(root, 'web/page/index.html'), 'utf8').replace(/\{\{(\w+)\}\}/g, (_, name) => names[name]);
writeFileSync(join(out, 'index.html'), html);
copyFileSync(join(root, 'web/page/icon.svg'), join(out, 'icon.svg'));
const licences = ['LICENSE-MIT', 'LICENSE-APACHE'].map((file) => readFileSync(join(root, file), 'utf8'));
writeFileSync(join(out, 'licence.txt'), `mrfgs is under either of these licences, at your option.\n\n${licences.join('\n\n')}`);
// Third-party licences.
copyFileSync(join(root, 'web/node_modules/three/LICENSE'), join(out, 'three-LICENSE.txt'));

for (const { name } of SCENES) {
    const [from, to] = [join(root, 'testdata', name), join(out, 'scenes', name)];
    mkdirSync(to, { recursive: true });
    for (const file of ['im0.png', 'im1.png', 'calib.txt']) {
        copyFileSync(join(from, file), join(to, file));
    }
    writeFileSync(join(to, 'small.png'), shrunk(readFileSync(join(from, 'im0.png')), 96, 72));
}

/** All files below a folder, as relative paths. */
const files = (folder) =>
    readdirSync(folder, { recursive: true, withFileTypes: true })
        .filter((entry) => entry.isFile())
        .map((entry) => relative(folder, join(entry.parentPath ?? entry.path, entry.name)))
        .sort();

// The views of the scenes, except the first one, are cached when they are opened.
const later = (file) => /\/(im[01]\.png|calib\.txt)$/.test(file) && !file.startsWith(`scenes/${SCENES[0].name}/`);
const kept = files(out).filter((file) => !later(file) && !/licen[cs]e/i.test(file));
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

const sized = (file) => [file, statSync(join(site, file)).size, gzipSync(readFileSync(join(site, file)), { level: 9 }).length];
const total = (name, rows) => [name, ...[1, 2].map((column) => rows.reduce((sum, row) => sum + row[column], 0))];
const sizes = files(site).filter((file) => !later(file) && !/licen[cs]e/i.test(file)).map(sized).sort((a, b) => b[2] - a[2]);
sizes.push(
    total('the first map', sizes.filter(([file]) => !/^(surface-view|mesh|service-worker)|small\.png$/.test(file))),
    total('the surface in 3-D, after the first map', sizes.filter(([file]) => /^(surface-view|mesh)/.test(file))),
    total('other scenes, when opened', files(site).filter(later).map(sized)),
);
console.log(`${'file'.padEnd(36)}${'bytes'.padStart(11)}${'gzip -9'.padStart(11)}`);
for (const [file, raw, packed] of sizes) {
    console.log(`${file.padEnd(36)}${raw.toLocaleString('en').padStart(11)}${packed.toLocaleString('en').padStart(11)}`);
}
