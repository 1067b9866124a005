// Headless browsers with WebGPU on software drivers.
import { existsSync } from 'node:fs';
import puppeteer from 'puppeteer-core';

const PLACES = {
    chromium: ['CHROMIUM', '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'],
    firefox: ['FIREFOX', '/usr/bin/firefox-esr', '/usr/bin/firefox'],
};

/** The path of a browser: from the variable CHROMIUM or FIREFOX, or the usual places; undefined if there is none. */
export function installed(name) {
    const [variable, ...paths] = PLACES[name];
    return [process.env[variable], ...paths].find((path) => path && existsSync(path));
}

// Swinging points would make pictures differ.
const CALM = ['--force-prefers-reduced-motion'];
const QUIET = ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'];
const WEBGPU = ['--enable-unsafe-webgpu', '--use-webgpu-adapter=swiftshader'];
// WebGL for the points, also in software.
const WEBGL = ['--enable-unsafe-swiftshader'];

/** Launches a browser that saves downloads in a folder; with `gpu: false` without WebGPU. */
export async function launch(name, { gpu = true, downloads } = {}) {
    const executablePath = installed(name);
    // Matches on software drivers are slow.
    const common = { executablePath, headless: true, protocolTimeout: 600_000 };
    if (name === 'firefox') {
        return puppeteer.launch({
            ...common,
            browser: 'firefox',
            extraPrefsFirefox: {
                'dom.webgpu.enabled': gpu,
                'dom.webgpu.workers.enabled': gpu,
                'gfx.webgpu.ignore-blocklist': gpu,
                'gfx.webgpu.force-enabled': gpu,
                'webgl.force-enabled': true,
                'ui.prefersReducedMotion': 1,
                ...(downloads && { 'browser.download.folderList': 2, 'browser.download.dir': downloads }),
            },
        });
    }
    const downloadBehavior = downloads && { policy: 'allow', downloadPath: downloads };
    return puppeteer.launch({ ...common, downloadBehavior, args: [...QUIET, ...CALM, ...WEBGL, ...(gpu ? WEBGPU : [])] });
}
