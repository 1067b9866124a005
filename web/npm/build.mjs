// Builds the npm package in target/web/npm, where scripts/web has put the engine.
//
//   node web/npm/build.mjs VERSION REPOSITORY LICENCES   REPOSITORY may be empty; LICENCES is the file with the licences of all dependencies
import { copyFileSync, mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { build } from 'esbuild';

const [version, repository, licences] = process.argv.slice(2);
const root = dirname(dirname(dirname(fileURLToPath(import.meta.url))));
const [engine, out] = ['engine', 'npm'].map((folder) => join(root, 'target/web', folder));

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });

const options = { bundle: true, format: 'esm', outdir: out, logLevel: 'warning', absWorkingDir: root, alias: { engine: join(engine, 'mrfgs_web.js') } };
const sources = (...names) => names.map((name) => join(root, 'web/npm', `${name}.ts`));
await build({ ...options, entryPoints: sources('index', 'worker'), target: ['chrome113', 'firefox115', 'safari16.4'] });
await build({ ...options, entryPoints: sources('node', 'worker-node'), platform: 'node', target: 'node18' });

copyFileSync(join(engine, 'mrfgs_web_bg.wasm'), join(out, 'mrfgs_web_bg.wasm'));
for (const name of ['index', 'node', 'matcher', 'calls']) {
    copyFileSync(join(root, 'target/web/npm-types/npm', `${name}.d.ts`), join(out, `${name}.d.ts`));
}
for (const name of ['LICENSE-MIT', 'LICENSE-APACHE']) {
    copyFileSync(join(root, name), join(out, name));
}
copyFileSync(licences, join(out, 'LICENSE-DEPENDENCIES'));
const wasm = readFileSync(join(out, 'mrfgs_web_bg.wasm'));
const megabytes = (bytes) => `${(bytes / 1e6).toFixed(1)} MB`;
const size = `${megabytes(wasm.length)}, ${megabytes(gzipSync(wasm, { level: 9 }).length)} by gzip`;
writeFileSync(join(out, 'README.md'), readFileSync(join(root, 'web/npm/README.md'), 'utf8').replace('SIZE', size));

const { name, ...rest } = JSON.parse(readFileSync(join(root, 'web/npm/package.json'), 'utf8'));
const address = repository ? { repository: { type: 'git', url: `git+${repository}.git`, directory: 'web/npm' } } : {};
writeFileSync(join(out, 'package.json'), `${JSON.stringify({ name, version, ...rest, ...address }, undefined, 4)}\n`);
