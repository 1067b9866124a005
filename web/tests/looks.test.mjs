// Tools for viewing results: lengths, both views at once, the previous map, meshes; and pairs from the camera.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { PNG } from 'pngjs';
import { levels } from '../png.mjs';
import { native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { BROWSER, Visit } from './lib/visit.mjs';

const [WIDTH, HEIGHT] = [320, 240];
const VIEWS = ['im0.png', 'im1.png'].map((file) => join(scene('mixed'), file));
/** From the calib.txt of the scene. */
const [F, CX, CY, BASELINE] = [240, 159.5, 119.5, 0.18604166666666666];

describe('looks', () => {
    let visit;
    const expected = native(...VIEWS, [], ['validity', 'confidence']);
    const { at: disparity } = disparities(expected.pfm);
    const confidences = levels(expected.confidence).levels;
    const trusted = levels(expected.validity).levels.map((value, i) => (value === 0 && confidences[i] >= 1 ? 1 : 0));
    const place = ([x, y]) => {
        const z = (F * BASELINE) / disparity(x, y);
        return [((x - CX) * z) / F, ((y - CY) * z) / F, z];
    };
    const apart = (a, b) => Math.hypot(...place(a).map((value, i) => value - place(b)[i]));
    /** The RGBA pixels of a canvas. */
    const canvas = async (id) => Buffer.from(await visit.tab.evaluate((id) => {
        const { width, height } = document.getElementById(id);
        return [...document.getElementById(id).getContext('2d').getImageData(0, 0, width, height).data];
    }, id));
    const click = async ([x, y]) => {
        const { x: left, y: top } = await visit.tab.$eval('#sheet', (sheet) => ({ x: sheet.getBoundingClientRect().x, y: sheet.getBoundingClientRect().y }));
        await visit.tab.mouse.click(Math.ceil(left + x), Math.ceil(top + y));
    };
    const length = async () => Number((await visit.says('#distance', /^[\d.]+ m apart$/)).split(' ')[0]);
    before(async () => {
        visit = await Visit.open();
        await visit.pair(scene('mixed'), join(scene('mixed'), 'calib.txt'));
        await visit.match({ device: 'cpu' });
    });
    after(() => visit.close());

    it('measures how far two points are apart', async () => {
        await visit.tab.click('#zoom-one');
        await click([50, 100]);
        assert.equal(await visit.text('#distance'), '', 'nobody asked');
        await visit.tab.click('#measure');
        await visit.says('#distance', /^Click on one end/);
        await click([50, 100]);
        await visit.says('#distance', /^Now click on the other end/);
        await click([200, 130]);
        const first = await length();
        assert.ok(Math.abs(first / apart([50, 100], [200, 130]) - 1) < 1e-4, `${first}`);
        assert.equal(await visit.tab.$eval('#ruler path', (path) => path.getAttribute('d')), 'M50.5 100.5L200.5 130.5');
        // The third click starts over. By keyboard, the point starts in the middle.
        await visit.tab.focus('#stage-box');
        await visit.tab.keyboard.press('ArrowRight');
        await visit.tab.keyboard.press('Enter');
        for (let i = 0; i < 9; i += 1) {
            await visit.tab.keyboard.down('Shift');
            await visit.tab.keyboard.press('ArrowUp');
            await visit.tab.keyboard.up('Shift');
        }
        await visit.tab.keyboard.press('Enter');
        const second = await length();
        assert.ok(Math.abs(second / apart([161, 120], [161, 30]) - 1) < 1e-4, `${second}`);
        // Another baseline gives another length.
        const baseline = (value) => visit.tab.$eval('#baseline', (input, value) => {
            input.value = value;
            input.dispatchEvent(new Event('change'));
        }, value);
        await baseline(String(2 * BASELINE));
        await visit.tab.waitForFunction((before) => parseFloat(document.getElementById('distance').textContent) > 1.9 * before, {}, second);
        await baseline(String(BASELINE));
        await visit.tab.click('#measure');
        assert.equal(await visit.text('#distance'), '');
        await visit.tab.click('#zoom-fit');
    });

    it('shows both views for glasses of two colours, and in turns', async () => {
        await visit.tab.click('#tab-left');
        await visit.tab.waitForSelector('#map[data-shown=left]');
        const left = await canvas('view');
        await visit.tab.click('#tab-stereo');
        await visit.tab.waitForSelector('#map[data-shown=stereo]');
        const both = await canvas('view');
        const [min, max] = await Promise.all(['#scale-min', '#scale-max'].map(async (id) => Number(await visit.text(id))));
        const right = PNG.sync.read(readFileSync(VIEWS[1])).data;
        const shift = Math.round((min + max) / 2);
        let differing = 0;
        for (let i = 0; i < left.length; i += 4) {
            const grey = 0.299 * left[i] + 0.587 * left[i + 1] + 0.114 * left[i + 2];
            assert.ok(Math.abs(both[i] - grey) <= 1, `${i}`);
            const x = (i / 4) % WIDTH;
            // The scale rounds its ends to a tenth.
            if (x >= shift + 1) {
                differing += [0, 4, -4].every((by) => both[i + 1] !== right[i - 4 * shift + by + 1]);
            }
        }
        assert.ok(differing < left.length / 400, `${differing}`);
        await visit.tab.select('#stereo', 'wiggle');
        const seen = new Set();
        const hash = () => visit.tab.evaluate(() => {
            const { data } = document.getElementById('view').getContext('2d').getImageData(0, 0, 320, 240);
            return data.reduce((sum, value, i) => (sum + value * (i % 977)) % 1_000_003, 0);
        });
        // Long enough for several alternations.
        for (const end = Date.now() + 10_000; seen.size < 2 && Date.now() < end;) {
            seen.add(await hash());
        }
        assert.equal(seen.size, 2);
        await visit.tab.select('#stereo', 'anaglyph');
        assert.deepEqual(await canvas('view'), both);
        await visit.tab.click('#tab-disparity');
        await visit.tab.waitForSelector('#map[data-shown=disparity]');
        // It has stopped.
        const still = await hash();
        await new Promise((resolve) => setTimeout(resolve, 500));
        assert.equal(await hash(), still);
    });

    it('shows the map before behind the divider', async () => {
        const option = () => visit.tab.$eval('#behind option[value=before]', ({ disabled, textContent }) => [disabled, textContent]);
        await visit.pair(scene('mixed'), join(scene('mixed'), 'calib.txt'));
        assert.deepEqual(await option(), [true, 'Map before']);
        const left = await canvas('under');
        await visit.match({ preset: 'fast' });
        assert.deepEqual(await option(), [false, 'Map before (default)']);
        assert.deepEqual(await canvas('under'), left);
        await visit.tab.select('#behind', 'before');
        const under = await canvas('under');
        // The map of the default preset, in the colours of the new one.
        await visit.match({ preset: 'default' });
        assert.deepEqual(await option(), [false, 'Map before (fast)']);
        const [view, other] = [await canvas('view'), await canvas('under')];
        let near = 0;
        for (let i = 0; i < view.length; i += 4) {
            near += [0, 1, 2].every((c) => Math.abs(view[i + c] - under[i + c]) <= 12);
        }
        assert.ok(near > 0.97 * (view.length / 4), `${near}`);
        assert.notDeepEqual(other, under);
        await visit.tab.select('#behind', 'left');
        assert.deepEqual(await canvas('under'), left);
    });

    it('saves the picture that is shown, with its scale', async () => {
        await visit.tab.click('#tab-disparity');
        await visit.tab.waitForSelector('#map[data-shown=disparity]');
        const { name, bytes } = await visit.save('picture');
        assert.equal(name, 'im0-picture.png');
        const picture = PNG.sync.read(bytes);
        assert.deepEqual([picture.width, picture.height], [WIDTH, HEIGHT + 16]);
        const map = 4 * WIDTH * HEIGHT;
        assert.equal(Buffer.compare(picture.data.subarray(0, map), await canvas('view')), 0);
        // The scale has text and many colours.
        const below = new Set(new Uint32Array(Uint8Array.from(picture.data.subarray(map)).buffer));
        assert.ok(below.has(0xffffffff) && below.size > 100, `${below.size} colours`);
        // Without a scale there is only the map.
        await visit.tab.click('#tab-left');
        await visit.tab.waitForSelector('#map[data-shown=left]');
        assert.equal(PNG.sync.read((await visit.save('picture')).bytes).height, HEIGHT);
        await visit.tab.click('#tab-disparity');
    });

    it('saves a mesh that is open at edges, as glTF and PLY', async () => {
        const least = (value) => visit.tab.$eval('#least', (slider, value) => {
            slider.value = value;
            slider.dispatchEvent(new Event('input'));
        }, value);
        const vertices = async () => Number((await visit.save('mesh')).bytes.toString('latin1', 0, 400).match(/element vertex (\d+)/)[1]);
        // Filled pixels too, until a confidence is asked for.
        assert.equal(await vertices(), WIDTH * HEIGHT);
        await least(1);
        const { name, bytes } = await visit.save('glb');
        assert.match(name, /\.glb$/);
        assert.deepEqual([0, 4, 8].map((at) => bytes.readUInt32LE(at)), [0x46546c67, 2, bytes.length]);
        const json = JSON.parse(bytes.toString('utf8', 20, 20 + bytes.readUInt32LE(12)));
        const start = 28 + bytes.readUInt32LE(12);
        const [positions, texture, triangles, image] = json.bufferViews.map(({ byteOffset, byteLength }) => bytes.subarray(start + byteOffset, start + byteOffset + byteLength));
        const [of, , corners] = json.accessors;
        const count = trusted.reduce((sum, one) => sum + one, 0);
        assert.equal(of.count, count);
        assert.equal(texture.length, 8 * count);
        assert.deepEqual(PNG.sync.read(Buffer.from(image)).data, PNG.sync.read(readFileSync(VIEWS[0])).data);
        const at = (i, k) => positions.readFloatLE(12 * i + 4 * k);
        let [smallest, area] = [Infinity, 0];
        for (let i = 0; i < corners.count; i += 3) {
            const three = [0, 1, 2].map((k) => triangles.readUInt32LE(4 * (i + k)));
            const seen = three.map((v) => (F * BASELINE) / -at(v, 2));
            assert.ok(Math.max(...seen) - Math.min(...seen) < 2.001, `${seen}`);
            // Counter-clockwise in the view.
            const [a, b, c] = three.map((v) => [texture.readFloatLE(8 * v) * WIDTH, -texture.readFloatLE(8 * v + 4) * HEIGHT]);
            const twice = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            smallest = Math.min(smallest, twice);
            area += twice / 2;
        }
        assert.ok(Math.abs(smallest - 1) < 1e-3, `${smallest}`);
        // Most of the measured area is covered, but depth edges are not.
        assert.ok(area > 0.9 * count && area < 0.995 * count, `${area} of ${count}`);
        // The vertex of pixel (100, 120).
        const index = trusted.slice(0, 120 * WIDTH + 100).reduce((sum, one) => sum + one, 0);
        assert.equal(trusted[120 * WIDTH + 100], 1);
        place([100, 120]).forEach((value, k) => assert.ok(Math.abs(at(index, k) - (k === 0 ? value : -value)) < 1e-4));

        const ply = await visit.save('mesh');
        assert.match(ply.name, /-mesh\.ply$/);
        const header = ply.bytes.toString('latin1', 0, ply.bytes.indexOf('end_header\n') + 11);
        assert.match(header, new RegExp(`element vertex ${count}\n[^]*element face ${corners.count / 3}\n`));
        const body = ply.bytes.subarray(header.length);
        assert.equal(body.length, 15 * count + 13 * (corners.count / 3));
        place([100, 120]).forEach((value, k) => assert.ok(Math.abs(body.readFloatLE(15 * index + 4 * k) - value) < 1e-4));
        assert.equal(body[15 * count], 3);
        await least(0);
    });

    it('lets points swing where motion is allowed, until somebody takes hold', { skip: BROWSER !== 'chromium' && 'only Chromium allows motion on demand' }, async () => {
        const other = await visit.browser.newPage();
        const drawn = () => other.$eval('#surface-canvas', (cloud) => Number(cloud.dataset.drawn));
        const moment = () => new Promise((resolve) => setTimeout(resolve, 400));
        const shown = async (motion) => {
            await other.emulateMediaFeatures([{ name: 'prefers-reduced-motion', value: motion }]);
            await other.goto(visit.url);
            await other.waitForSelector('html[data-gpu]');
            if (motion === 'reduce') {
                await other.click('#tab-surface');
            }
            await other.waitForFunction(() => Number(document.getElementById('surface-canvas').dataset.drawn) > 0);
            await moment();
        };
        await shown('no-preference');
        // Starts by itself for a visitor who has not interacted.
        assert.equal(await other.$eval('#tab-surface', (tab) => tab.getAttribute('aria-selected')), 'true');
        assert.equal(await other.$eval('#reset-view', (button) => button.textContent), 'Stop');
        const shift = await other.evaluate(() => new Promise((resolve) => {
            new PerformanceObserver((list) => resolve(list.getEntries().reduce((sum, entry) => sum + entry.value, 0))).observe({ type: 'layout-shift', buffered: true });
            setTimeout(() => resolve(0), 500);
        }));
        assert.ok(shift < 0.1, `layout shift ${shift}`);
        const first = await drawn();
        await other.waitForFunction((first) => Number(document.getElementById('surface-canvas').dataset.drawn) > first + 3, {}, first);
        await other.focus('#surface-canvas');
        await other.keyboard.press('ArrowLeft');
        await moment();
        const held = await drawn();
        await moment();
        assert.equal(await drawn(), held);
        assert.equal(await other.$eval('#reset-view', (button) => button.textContent), 'Reset view');
        await shown('reduce');
        const still = await drawn();
        await moment();
        assert.equal(await drawn(), still);
        // The map stays once the visitor has interacted.
        await other.emulateMediaFeatures([{ name: 'prefers-reduced-motion', value: 'no-preference' }]);
        await other.goto(visit.url);
        await other.waitForSelector('#outcome:not([hidden])');
        await other.keyboard.press('Tab');
        await new Promise((resolve) => setTimeout(resolve, 4000));
        assert.equal(await other.$eval('#tab-disparity', (tab) => tab.getAttribute('aria-selected')), 'true');
        await other.close();
        await visit.tab.bringToFront();
    });

    it('says why there is no length where the cameras are a guess', async () => {
        // Typed cameras are kept only for pairs of the same size.
        await visit.pair(scene('slanted'));
        assert.equal(await visit.tab.$eval('#behind option[value=before]', ({ disabled }) => disabled), true);
        await visit.tab.click('#measure');
        await click([50, 100]);
        await click([60, 110]);
        await visit.says('#distance', /^No length: the cameras are a guess/);
        await visit.tab.click('#measure');
    });

    it('keeps its legends and the selected tab in forced colours', { skip: BROWSER !== 'chromium' && 'only Chromium forces colours on demand' }, async () => {
        const session = await visit.tab.createCDPSession();
        const forced = (value) => session.send('Emulation.setEmulatedMedia', { features: [{ name: 'forced-colors', value }] });
        await forced('active');
        await visit.tab.click('#tab-validity');
        await visit.tab.waitForSelector('#map[data-shown=validity]');
        const seen = await visit.tab.evaluate(() => {
            const [tab, other, swatch] = ['#tab-validity', '#tab-left', '#legend i:not([hidden])'].map((selector) => getComputedStyle(document.querySelector(selector)));
            return { border: [tab.borderTopWidth, other.borderTopWidth], colours: new Set([...document.querySelectorAll('#legend i:not([hidden])')].map((i) => getComputedStyle(i).backgroundColor)).size, adjust: swatch.forcedColorAdjust };
        });
        assert.deepEqual(seen.border, ['2px', '0px']);
        assert.ok(seen.colours > 2 && seen.adjust === 'none', JSON.stringify(seen));
        await forced('none');
        await visit.tab.click('#tab-disparity');
    });
});

describe('a camera', () => {
    let visit;
    before(async () => {
        const photos = ['left.png', 'right.png'].map((file) => `data:image/png;base64,${readFileSync(join(scene('raw'), file)).toString('base64')}`);
        // A camera that shows the left photograph, and after a shot the right one.
        const fake = async (photos) => {
            navigator.mediaDevices.getUserMedia = async ({ video }) => {
                if (window.refuses || !video) {
                    throw new DOMException('Permission denied', 'NotAllowedError');
                }
                const canvas = document.createElement('canvas');
                [canvas.width, canvas.height] = [240, 180];
                const context = canvas.getContext('2d');
                const images = await Promise.all(photos.map(async (photo) => {
                    const bytes = Uint8Array.from(atob(photo.split(',')[1]), (c) => c.charCodeAt(0));
                    return createImageBitmap(new Blob([bytes], { type: 'image/png' }));
                }));
                window.look = 0;
                const draw = () => {
                    context.drawImage(images[window.look], 0, 0);
                    setTimeout(draw, 30);
                };
                draw();
                window.stream = canvas.captureStream(30);
                return window.stream;
            };
        };
        visit = await Visit.open({ before: ({ tab }) => tab.evaluateOnNewDocument(fake, photos) });
    });
    after(() => visit.close());

    it('takes a pair, which is rectified by its matches', async () => {
        await visit.tab.click('#open-camera');
        await visit.tab.waitForSelector('#shoot:not([disabled])');
        assert.equal(await visit.text('#shoot'), 'Take the left view');
        // A double click must not take both views.
        await visit.tab.evaluate(() => {
            document.getElementById('shoot').click();
            document.getElementById('shoot').click();
        });
        await visit.says('#shoot', /^Take the right view$/);
        await visit.says('#camera-about', /to the right/);
        await visit.tab.evaluate(() => {
            window.look = 1;
            return new Promise((resolve) => setTimeout(resolve, 500));
        });
        await visit.changed(() => visit.tab.click('#shoot'));
        await visit.state('done', 'failed');
        assert.match(await visit.text('#facts'), /^240 × 180 pixels/, await visit.text('#pair-problem'));
        assert.match(await visit.text('#notes'), /rectified/i);
        assert.deepEqual(await visit.tab.evaluate(() => [document.getElementById('camera').open, window.stream.active]), [false, false]);
        assert.match((await visit.save('png')).name, /^camera-disparity/);
    });

    it('says why there is none, and leaves the pair as it is', async () => {
        await visit.tab.evaluate(() => (window.refuses = true));
        await visit.tab.click('#open-camera');
        await visit.says('#camera-problem', /^The camera cannot be used: Permission denied\./);
        assert.equal(await visit.tab.$eval('#shoot', (button) => button.disabled), true);
        await visit.tab.keyboard.press('Escape');
        assert.equal(await visit.tab.$eval('#camera', (dialog) => dialog.open), false);
        assert.match(await visit.text('#facts'), /^240 × 180 pixels/);
    });
});
