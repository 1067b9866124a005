// Runs all tests in the named browser, or in all installed ones.
import { spawnSync } from 'node:child_process';
import { readdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { installed } from './lib/browser.mjs';

const folder = dirname(fileURLToPath(import.meta.url));
const tests = readdirSync(folder).filter((file) => file.endsWith('.test.mjs')).map((file) => join(folder, file));
const named = process.argv[2];
const required = named !== undefined || process.env.MRFGS_REQUIRE_BROWSERS === '1';
let failed = false;
for (const name of named ? [named] : ['chromium', 'firefox']) {
    const path = installed(name);
    if (!path) {
        console.error(`SKIPPED in ${name}: it is not installed; its path may be in the variable ${name.toUpperCase()}`);
        failed ||= required;
        continue;
    }
    const { stdout } = spawnSync(path, ['--version'], { encoding: 'utf8', stdio: ['ignore', 'pipe', 'ignore'] });
    console.log(`${name}: ${stdout.trim()}`);
    // Sequentially, as software drivers use all cores.
    const { status } = spawnSync(process.execPath, ['--test', '--test-concurrency=1', '--test-reporter=spec', ...tests], {
        stdio: 'inherit',
        env: { ...process.env, MRFGS_BROWSER: name },
    });
    failed ||= status !== 0;
}
process.exit(failed ? 1 : 0);
