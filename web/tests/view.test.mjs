// The page of `mrfgs match --also view`, opened as a file.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { pathToFileURL } from 'node:url';
import { levels } from '../png.mjs';
import { launch } from './lib/browser.mjs';
import { PROGRAM } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { BROWSER } from './lib/visit.mjs';

/** From the calib.txt of the scene: focal length times baseline. */
const DEPTH_TIMES_DISPARITY = 240 * 0.18604166666666666;
const NO_WEBGL = 'This browser has no WebGL 2, so it cannot show the surface.';

describe('view', () => {
    const folder = mkdtempSync(join(tmpdir(), 'mrfgs-view-'));
    const faults = [];
    let browser, tab, map, confidence, validity, webgl;

    const mrfgs = (...args) => execFileSync(PROGRAM, args, { cwd: folder });
    /** Opens the page `name` and waits until it shows everything; `before` is run ahead of its script. */
    const open = async (name, before) => {
        const opened = await browser.newPage();
        await opened.setViewport({ width: 1280, height: 800 });
        opened.on('pageerror', (error) => faults.push(error.message));
        opened.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
        opened.on('request', (request) => /^(file|blob|data):/.test(request.url()) || faults.push(`a request to ${request.url()}`));
        if (before) {
            await opened.evaluateOnNewDocument(before);
        }
        await opened.goto(pathToFileURL(join(folder, name)).href);
        await opened.waitForSelector('html[data-shown]');
        return opened;
    };
    const text = (selector, page = tab) => page.$eval(selector, (element) => element.textContent);
    /** Moves the pointer to a pixel of a canvas of the page. */
    const point = async (id, x, y) => {
        const box = await tab.$eval(id, (canvas) => {
            const { x, y, width, height } = canvas.getBoundingClientRect();
            return { x, y, width, height };
        });
        await tab.mouse.move(box.x + ((x + 0.5) / 320) * box.width, box.y + ((y + 0.5) / 240) * box.height);
    };
    /** The start of what the page must say of a pixel. */
    const expected = (x, y) => {
        const d = map.at(x, y);
        const depth = Number((DEPTH_TIMES_DISPARITY / d).toPrecision(4));
        return `x ${x}, y ${y}: ${d.toFixed(2)} px · depth ${depth} m · confidence ${confidence.levels[y * 320 + x]} · `;
    };
    /** The colours of the surface after it is drawn again, as the share of pixels that show it and their sum by columns. */
    const drawn = () => tab.evaluate(() => new Promise((resolve) => {
        // The buffer keeps its content until the end of the frame.
        window.dispatchEvent(new Event('resize'));
        const scene = document.getElementById('scene');
        scene.dispatchEvent(new WheelEvent('wheel', { deltaY: 0, cancelable: true }));
        requestAnimationFrame(() => {
            const copy = new OffscreenCanvas(64, 64);
            const context = copy.getContext('2d');
            context.drawImage(scene, 0, 0, 64, 64);
            const { data } = context.getImageData(0, 0, 64, 64);
            const bright = Array.from({ length: 64 * 64 }, (_, i) => data[4 * i] + data[4 * i + 1] + data[4 * i + 2]);
            resolve({ share: bright.filter((value) => value > 90).length / bright.length, bright });
        });
    }));
    const change = (a, b) => a.bright.reduce((sum, value, i) => sum + Math.abs(value - b.bright[i]), 0) / a.bright.length;

    before(async () => {
        const views = ['im0.png', 'im1.png'].map((file) => join(scene('mixed'), file));
        mrfgs('match', ...views, 'd.pfm', '--also', 'view,confidence,validity', '--device', 'cpu', '--quiet');
        mrfgs('view', 'd.pfm', '--output', 'guessed.html');
        map = disparities(readFileSync(join(folder, 'd.pfm')));
        [confidence, validity] = ['confidence', 'validity'].map((word) => levels(readFileSync(join(folder, `d.${word}.png`))));
        browser = await launch(BROWSER, { gpu: false });
        tab = await open('d.view.html');
        webgl = await tab.evaluate(() => Boolean(document.createElement('canvas').getContext('webgl2')));
    });
    /** Skips a test of the surface, visibly, in a browser without WebGL 2. */
    const isLacking = async (test) => {
        if (!webgl) {
            assert.equal(await text('#note'), NO_WEBGL);
            console.error('SKIPPED the surface in 3-D: this browser has no WebGL without a display');
            test.skip('no WebGL');
        }
        return !webgl;
    };
    after(async () => {
        await browser.close();
        rmSync(folder, { recursive: true });
        assert.deepEqual(faults, []);
    });

    it('reads the values under the pointer, in both views', async () => {
        assert.equal(await text('h1'), 'd');
        for (const [id, x, y] of [['#map', 50, 100], ['#left', 200, 130], ['#map', 3, 236], ['#left', 316, 3]]) {
            await point(id, x, y);
            const said = await text('#readout');
            assert.ok(said.startsWith(expected(x, y)), `${said}, not ${expected(x, y)}`);
        }
        // A pixel that was measured, and one that was hidden and is filled.
        const names = [[(value) => value === 0, 'measured'], [(value) => value === 18, 'occluded, filled']];
        for (const [is, name] of names) {
            const i = validity.levels.findIndex((value, i) => i > 320 * 60 && is(value));
            await point('#map', i % 320, Math.floor(i / 320));
            assert.equal(await text('#readout'), expected(i % 320, Math.floor(i / 320)) + name);
        }
    });

    it('reads the map by keyboard', async () => {
        await point('#map', 160, 120);
        await tab.focus('#map');
        await tab.keyboard.press('ArrowRight');
        await tab.keyboard.down('Shift');
        await tab.keyboard.press('ArrowUp');
        await tab.keyboard.up('Shift');
        assert.ok((await text('#readout')).startsWith(expected(161, 110)));
    });

    it('paints the map in colours, with a scale', async () => {
        const warmth = await tab.$eval('#map', (canvas) => {
            const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            return [20, 235].map((y) => data[4 * (320 * y + 20)] - data[4 * (320 * y + 20) + 2]);
        });
        assert.ok(warmth[0] < 0 && warmth[1] > 0, `${warmth}: far is cold, near is warm`);
        const ticks = (await tab.$$eval('#ticks span', (all) => all.map((tick) => tick.textContent)));
        const numbers = ticks.map((tick) => parseFloat(tick));
        assert.ok(numbers.length > 3 && numbers.every((value, i) => i === 0 || value > numbers[i - 1]), `${ticks}`);
        assert.ok(numbers[0] >= 0 && numbers.at(-1) <= 47 && numbers.at(-1) - numbers[0] > 20, `${ticks}`);
    });

    it('draws the surface, and turns, zooms and resets it', async (test) => {
        if (await isLacking(test)) {
            return;
        }
        const start = await drawn();
        assert.ok(start.share > 0.25 && start.share < 0.95, `${start.share}`);
        await tab.focus('#scene');
        await tab.keyboard.press('ArrowLeft');
        const turned = await drawn();
        assert.ok(change(start, turned) > 5);
        await tab.keyboard.press('Home');
        assert.equal(change(start, await drawn()), 0);
        await tab.keyboard.press('-');
        assert.ok((await drawn()).share < start.share - 0.02);
        await tab.click('#reset');
        assert.equal(change(start, await drawn()), 0);
        const { x, y } = await (await tab.$('#scene')).boundingBox();
        await tab.mouse.move(x + 200, y + 200);
        await tab.mouse.down();
        await tab.mouse.move(x + 260, y + 220);
        await tab.mouse.up();
        const dragged = await drawn();
        assert.ok(change(start, dragged) > 5);
        await tab.mouse.move(x + 100, y + 100);
        assert.equal(change(dragged, await drawn()), 0, 'nothing is held');
        await tab.mouse.wheel({ deltaY: 900 });
        assert.ok((await drawn()).share < dragged.share - 0.05);
        await tab.click('#reset');
        assert.match(await text('#note'), /^Depths are in m\./);
    });

    it('says that it guesses the cameras, and shows a map alone', async () => {
        const alone = await open('guessed.html');
        assert.match(await text('#note', alone), webgl ? /^Not to scale, as the cameras are not known/ : /no WebGL 2/);
        assert.equal(await alone.$eval('#left-view', (view) => view.checkVisibility()), false);
        await alone.focus('#map');
        await alone.keyboard.press('ArrowLeft');
        assert.doesNotMatch(await text('#readout', alone), /depth/);
        await alone.close();
    });

    it('shows the map without WebGL 2', async () => {
        const plain = await open('d.view.html', () => {
            const own = HTMLCanvasElement.prototype.getContext;
            HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
                return kind === 'webgl2' ? null : own.call(this, kind, ...more);
            };
        });
        assert.equal(await text('#note', plain), NO_WEBGL);
        const width = await plain.$eval('#map', (canvas) => canvas.width);
        assert.equal(width, 320);
        await plain.close();
    });

    it('has maps and surface side by side, and one above the other on a phone', async (test) => {
        if (await isLacking(test)) {
            return;
        }
        const place = (id) => tab.$eval(id, (element) => {
            const { left, right, top, bottom } = element.getBoundingClientRect();
            return { left, right, top, bottom };
        });
        const [views, wide] = [await place('#views'), await place('#scene')];
        assert.ok(views.right < wide.left && wide.bottom < 800 && views.bottom <= 800);
        await tab.setViewport({ width: 360, height: 740 });
        assert.ok((await place('#views')).bottom < (await place('#scene')).top);
        assert.equal(await tab.evaluate(() => document.documentElement.scrollWidth), 360);
        await tab.setViewport({ width: 1280, height: 800 });
    });

    it('has nothing that axe finds fault with', { skip: BROWSER !== 'chromium' && 'it is the same page in all browsers' }, async () => {
        const other = await browser.newPage();
        // The Content-Security-Policy of the page allows no other script.
        await other.setBypassCSP(true);
        await other.goto(pathToFileURL(join(folder, 'd.view.html')).href);
        await other.waitForSelector('html[data-shown]');
        await other.addScriptTag({ path: createRequire(import.meta.url).resolve('axe-core/axe.min.js') });
        for (const scheme of ['light', 'dark']) {
            await other.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
            const found = await other.evaluate(async () => (await window.axe.run()).violations.map(({ id, nodes }) => [id, nodes.map(({ target }) => target.join(' '))]));
            assert.deepEqual(found, [], scheme);
        }
        await other.close();
    });
});
