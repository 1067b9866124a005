// Views of a result with mouse and keyboard, on wide and narrow screens.
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { levels } from '../png.mjs';
import { native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { BROWSER, Visit } from './lib/visit.mjs';

const VIEWS = ['disparity', 'confidence', 'validity', 'left'];
const views = ['im0.png', 'im1.png'].map((file) => join(scene('mixed'), file));

describe('views', () => {
    let visit;
    const expected = native(...views, [], ['confidence', 'validity', 'points']);
    const focused = () => visit.tab.evaluate(() => document.activeElement.id || document.activeElement.dataset.scene || document.activeElement.name);
    const shown = (view) => visit.tab.waitForSelector(`#map[data-shown=${view}]`);
    before(async () => {
        visit = await Visit.open();
        await visit.pair(scene('mixed'), join(scene('mixed'), 'calib.txt'));
        await visit.match({ device: 'cpu' });
    });
    after(() => visit.close());

    it('reads out the pixel under the pointer', async () => {
        const map = disparities(expected.pfm);
        const [confidence, validity] = [levels(expected.confidence).levels, levels(expected.validity).levels];
        await visit.tab.click('#zoom-one');
        for (const [x, y] of [[0, 0], [319, 239], [100, 150], [3, 120]]) {
            const box = await visit.tab.$eval('#sheet', (sheet) => ({ x: sheet.getBoundingClientRect().x, y: sheet.getBoundingClientRect().y }));
            // Integers, which all browsers treat alike.
            await visit.tab.mouse.move(Math.ceil(box.x + x), Math.ceil(box.y + y));
            const said = await visit.says('#readout', new RegExp(`^x ${x}, y ${y} `));
            assert.match(said, new RegExp(`disparity ${map.at(x, y).toFixed(2)} px · confidence ${confidence[y * 320 + x]} `));
            assert.equal(/measured/.test(said), validity[y * 320 + x] === 0, said);
            // Z = baseline * f / d, from the calib.txt.
            const depth = Number(said.match(/depth ([\d.]+) m$/)[1]);
            assert.ok(Math.abs(depth / ((0.18604166666666666 * 240) / map.at(x, y)) - 1) < 1e-4, said);
        }
        await visit.tab.click('#zoom-fit');
    });

    it('zooms', async () => {
        const size = () => visit.tab.$eval('#sheet', (sheet) => sheet.getBoundingClientRect().width);
        await visit.tab.click('#zoom-one');
        assert.equal(await size(), 320);
        await visit.tab.click('#zoom-in');
        assert.equal(await size(), 640);
        assert.equal(await visit.tab.$eval('#view', (view) => getComputedStyle(view).imageRendering), 'pixelated');
        await visit.tab.click('#zoom-out');
        await visit.tab.click('#zoom-out');
        assert.equal(await size(), 160);
        await visit.tab.click('#zoom-fit');
        const box = await visit.tab.$eval('#stage-box', (box) => [box.scrollWidth - box.clientWidth, box.scrollHeight - box.clientHeight]);
        assert.deepEqual(box, [0, 0]);
    });

    it('draws the left view up to the divider', async () => {
        const colours = () => visit.tab.evaluate(() => {
            const read = (id, x) => [...document.getElementById(id).getContext('2d').getImageData(x, 120, 1, 1).data];
            return { clip: getComputedStyle(document.getElementById('under')).clipPath, left: read('under', 10), map: read('view', 10) };
        });
        assert.notDeepEqual((await colours()).left, (await colours()).map);
        await visit.tab.focus('#wipe');
        await visit.tab.keyboard.press('End');
        assert.match((await colours()).clip, /inset\(0(px|%)? (calc\()?0/);
        const divider = await (await visit.tab.$('#divider span')).boundingBox();
        const sheet = await (await visit.tab.$('#sheet')).boundingBox();
        const y = divider.y + divider.height / 2;
        await visit.tab.mouse.move(divider.x + divider.width / 2, y);
        await visit.tab.mouse.down();
        await visit.tab.mouse.move(sheet.x + sheet.width / 4, y, { steps: 5 });
        await visit.tab.mouse.up();
        assert.equal(await visit.tab.$eval('#wipe', (wipe) => wipe.value), '25');
        await visit.tab.$eval('#wipe', (wipe) => {
            wipe.value = 0;
            wipe.dispatchEvent(new Event('input'));
        });
    });

    it('shows every view with its legend', async () => {
        for (const view of VIEWS) {
            await visit.tab.click(`#tab-${view}`);
            await shown(view);
            const seen = await visit.tab.evaluate(() => ['scale', 'legend'].map((id) => document.getElementById(id).checkVisibility()));
            assert.deepEqual(seen, [['disparity', 'confidence'].includes(view), view === 'validity'], view);
        }
        await visit.tab.click('#tab-validity');
        await shown('validity');
        const none = levels(expected.validity).levels.filter((value) => value === 0).length;
        const share = `${((100 * none) / (320 * 240)).toFixed(1)} %`;
        assert.ok((await visit.text('#legend')).includes(share), `${share}: ${await visit.text('#legend')}`);
        await visit.tab.click('#tab-disparity');
        await shown('disparity');
        // Nearly all measured disparities are between the ends of the colours.
        const map = disparities(expected.pfm);
        const reasons = levels(expected.validity).levels;
        const measured = [...reasons.keys()].filter((i) => reasons[i] === 0).map((i) => map.at(i % 320, Math.floor(i / 320))).sort((a, b) => a - b);
        const end = (part) => measured[Math.round(part * (measured.length - 1))];
        assert.equal(Number(await visit.text('#scale-min')), Number(end(0.01).toFixed(1)));
        assert.equal(Number(await visit.text('#scale-max')), Number(end(0.99).toFixed(1)));
    });

    it('turns the surface, films it, and hides what is filled and of less confidence', async (test) => {
        await visit.tab.click('#tab-surface');
        if (!(await visit.tab.evaluate(() => Boolean(document.createElement('canvas').getContext('webgl2'))))) {
            await visit.says('#surface-note', /cannot be shown: this browser offers no WebGL 2/);
            console.error('SKIPPED the surface in 3-D: this browser has no WebGL without a display');
            test.skip('no WebGL');
            await visit.tab.click('#tab-disparity');
            return;
        }
        await visit.tab.waitForFunction(() => Number(document.getElementById('surface').dataset.points) > 0);
        const points = () => visit.tab.$eval('#surface', (panel) => Number(panel.dataset.points));
        const map = disparities(expected.pfm);
        const pixels = Array.from({ length: 320 * 240 }, (_, i) => Number.isFinite(map.at(i % 320, Math.floor(i / 320))));
        const [reasons, confidences] = [levels(expected.validity).levels, levels(expected.confidence).levels];
        const count = pixels.filter(Boolean).length;
        assert.equal(await points(), count);
        const filled = pixels.filter((there, i) => there && reasons[i] !== 0).length;
        assert.equal((await visit.text('#surface-note')).replaceAll(',', ''), `${count} points. ${filled} are filled; a least confidence of 1 hides them.`);
        const picture = async () => {
            // Without the focus ring. Requested changes are drawn in the next frame.
            await visit.tab.evaluate(() => {
                document.activeElement.blur();
                return new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
            });
            return Buffer.from(await (await visit.tab.$('#surface-canvas')).screenshot());
        };
        const before = await picture();
        await visit.tab.focus('#surface-canvas');
        await visit.tab.keyboard.press('ArrowLeft');
        const turned = await picture();
        assert.ok(!before.equals(turned));
        await visit.tab.focus('#surface-canvas');
        await visit.tab.keyboard.press('Home');
        assert.ok(before.equals(await picture()));
        const box = await (await visit.tab.$('#surface-canvas')).boundingBox();
        await visit.tab.mouse.move(box.x + 200, box.y + 200);
        await visit.tab.mouse.down();
        await visit.tab.mouse.move(box.x + 260, box.y + 220, { steps: 3 });
        await visit.tab.mouse.up();
        assert.ok(!before.equals(await picture()));
        await visit.tab.click('#reset-view');
        assert.ok(before.equals(await picture()));
        const film = await visit.download(() => visit.tab.click('#film'));
        assert.match(film.name, /^im0-film\.(mp4|webm)$/);
        assert.ok((await visit.length(film.bytes)) > 4);
        assert.ok(before.equals(await picture()));
        await visit.tab.focus('#least');
        await visit.tab.keyboard.press('ArrowRight');
        assert.equal(await points(), pixels.filter((there, i) => there && reasons[i] === 0 && confidences[i] >= 1).length);
        await visit.tab.keyboard.press('End');
        const sure = await points();
        assert.ok(sure < count / 2, `${sure} of ${count}`);
        assert.ok(!before.equals(await picture()));
        const ply = await visit.save('ply');
        assert.match(ply.bytes.toString('latin1', 0, 400), new RegExp(`element vertex ${sure}\n`));
        await visit.tab.focus('#least');
        await visit.tab.keyboard.press('Home');
        await visit.tab.click('#tab-disparity');
    });

    it('takes other cameras', async () => {
        await visit.tab.click('#tab-surface');
        const baseline = await visit.tab.$eval('#baseline', (input) => input.value);
        const set = (value) => visit.tab.$eval('#baseline', (input, value) => {
            input.value = value;
            input.dispatchEvent(new Event('change'));
        }, value);
        await set('-1');
        await visit.says('#cameras-problem', /above 0/);
        await set(baseline);
        assert.equal(await visit.text('#cameras-problem'), '');
        await visit.tab.click('#tab-disparity');
    });

    it('works by keyboard alone', async () => {
        await visit.tab.focus('#left-file');
        // The focus is visible to keyboard users.
        await visit.tab.keyboard.press('Tab');
        await visit.tab.keyboard.down('Shift');
        await visit.tab.keyboard.press('Tab');
        await visit.tab.keyboard.up('Shift');
        const order = [];
        for (let i = 0; i < 20; i += 1) {
            order.push(await focused());
            // The focused element is marked visibly.
            const outlined = await visit.tab.evaluate(() => {
                const element = document.activeElement;
                const outlined = element.type === 'file' ? element.nextElementSibling.querySelector('.thumb') : element;
                return getComputedStyle(outlined).outlineStyle !== 'none';
            });
            assert.ok(outlined, order.at(-1));
            if (order.at(-1) === 'match') {
                break;
            }
            await visit.tab.keyboard.press('Tab');
        }
        assert.deepEqual(order, ['left-file', 'swap', 'right-file', 'add-prior', 'open-camera', 'open-video', 'mixed', 'slanted', 'thin', 'steep', 'preset', 'size', 'range', 'device', 'match']);
        await visit.tab.focus('[data-scene=slanted]');
        await visit.changed(() => visit.tab.keyboard.press('Enter'));
        await visit.state('done');
        await visit.tab.focus('#match');
        await visit.tab.keyboard.press('Enter');
        await visit.state('matching', 'done');
        await visit.state('done');
        await visit.tab.focus('#tab-disparity');
        for (const view of ['confidence', 'validity', 'left']) {
            await visit.tab.keyboard.press('ArrowRight');
            await shown(view);
            assert.equal(await focused(), `tab-${view}`);
        }
        await visit.tab.keyboard.press('Home');
        await shown('disparity');
        await visit.tab.focus('#stage-box');
        await visit.tab.keyboard.press('ArrowRight');
        await visit.says('#readout', /^x 121, y 90 · disparity \d/);
        await visit.tab.keyboard.press('ArrowDown');
        await visit.says('#readout', /^x 121, y 91 /);
        await visit.tab.keyboard.press('+');
        assert.notEqual(await visit.tab.$eval('#stage-box', (box) => box.dataset.zoom), 'fit');
        await visit.tab.keyboard.press('0');
        assert.equal(await visit.tab.$eval('#stage-box', (box) => box.dataset.zoom), 'fit');
    });

    it('has a name for every control', async () => {
        const nameless = await visit.tab.evaluate(() =>
            [...document.querySelectorAll('button, input, select, [role=application], progress')]
                .filter((e) => !(e.labels?.length || e.textContent.trim() || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')))
                .map((e) => e.outerHTML),
        );
        assert.deepEqual(nameless, []);
    });

    it('shows the map in relief', async () => {
        const sum = () => visit.tab.evaluate(() => {
            const { data } = document.getElementById('view').getContext('2d').getImageData(0, 0, 240, 180);
            return data.reduce((all, value) => all + value, 0);
        });
        const plain = await sum();
        await visit.tab.click('#relief');
        assert.notEqual(await sum(), plain);
        await visit.tab.click('#relief');
        assert.equal(await sum(), plain);
    });

    it('has an address that holds scene and settings', async () => {
        assert.match(visit.tab.url(), /#scene=slanted$/);
        const other = await visit.browser.newPage();
        await other.goto(`${visit.url}#scene=thin&preset=default&range=0,40`);
        await other.waitForSelector('html[data-gpu]');
        const facts = await other.$eval('#facts', (facts) => facts.textContent);
        assert.match(facts, /^240 × 180 pixels · range 0 to 40 · default · .*CPU path/);
        // Also when it is edited.
        await other.evaluate(() => (location.hash = '#scene=mixed&preset=fast&range=0,40'));
        await other.waitForFunction(() => /^320 × 240 pixels · range 0 to 40 · fast/.test(document.getElementById('facts').textContent));
        await other.close();
        await visit.tab.bringToFront();
    });

    it('zooms by two fingers, and not the page', { skip: BROWSER !== 'chromium' && 'only Chromium makes events of fingers' }, async () => {
        await visit.tab.click('#zoom-fit');
        const size = () => visit.tab.$eval('#sheet', (sheet) => sheet.getBoundingClientRect().width);
        const before = await size();
        const prevented = await visit.tab.$eval('#stage-box', (box) => {
            const { x, y, width, height } = box.getBoundingClientRect();
            const at = (identifier, by) => new Touch({ identifier, target: box, clientX: x + width / 2 + by, clientY: y + height / 2 });
            const touch = (type, by) => box.dispatchEvent(new TouchEvent(type, { touches: [at(1, -by), at(2, by)], bubbles: true, cancelable: true }));
            touch('touchstart', 40);
            return !touch('touchmove', 80);
        });
        assert.ok(prevented);
        assert.ok(Math.abs((await size()) / before - 2) < 0.02, `${before} to ${await size()}`);
        await visit.tab.click('#zoom-fit');
    });

    it('has room for the map on a tablet, and on paper has no form', async () => {
        await visit.tab.setViewport({ width: 768, height: 1024 });
        const height = await visit.tab.$eval('#stage-box', (box) => box.getBoundingClientRect().height);
        assert.ok(height > 500, `${height}`);
        if (BROWSER === 'chromium') {
            // Firefox cannot emulate print.
            await visit.tab.emulateMediaType('print');
            const seen = await visit.tab.evaluate(() => ['form', 'map', 'scale'].map((id) => document.getElementById(id).checkVisibility()));
            await visit.tab.emulateMediaType(null);
            assert.deepEqual(seen, [false, true, true]);
        }
        await visit.tab.setViewport({ width: 1280, height: 800 });
    });

    it('shows all of a portrait, and images of 16 bits not dark', async () => {
        const other = await visit.browser.newPage();
        await other.goto(visit.url);
        await other.waitForSelector('html[data-gpu]');
        const folder = mkdtempSync(join(tmpdir(), 'mrfgs-thumbs-'));
        // A portrait image with 12 of 16 bits used.
        const [width, height] = [60, 120];
        const grey = Buffer.alloc(2 * width * height);
        for (let i = 0; i < width * height; i += 1) {
            grey.writeUInt16BE(1000 + ((i * 7919) % 3000), 2 * i);
        }
        const file = join(folder, 'tall.pgm');
        writeFileSync(file, Buffer.concat([Buffer.from(`P5 ${width} ${height} 65535\n`), grey]));
        await (await other.$('#left-file')).uploadFile(file);
        await (await other.$('#right-file')).uploadFile(file);
        await other.waitForFunction(() => /tall/.test(document.querySelector('#right .name').textContent) && document.querySelector('#left canvas:not([hidden])'));
        const seen = await other.$eval('#left canvas', (canvas) => {
            const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
            const mean = data.reduce((sum, value, i) => sum + (i % 4 === 0 ? value : 0), 0) / (data.length / 4);
            return { fit: getComputedStyle(canvas).objectFit, shape: canvas.height / canvas.width, mean };
        });
        assert.deepEqual([seen.fit, seen.shape], ['contain', 2]);
        assert.ok(seen.mean > 60, `${seen.mean}`);
        await other.close();
        rmSync(folder, { recursive: true });
        await visit.tab.bringToFront();
    });

    it('tells those who listen which file a view has', async () => {
        const held = await visit.tab.evaluate(() => ['left-file', 'right-file'].map((id) => document.getElementById(id).files[0]?.name));
        assert.deepEqual(held, ['slanted im0.png', 'slanted im1.png']);
    });

    it('has nothing that axe finds fault with', { skip: BROWSER !== 'chromium' && 'it is the same page in all browsers' }, async () => {
        const other = await visit.browser.newPage();
        // The Content-Security-Policy of the page allows no other script.
        await other.setBypassCSP(true);
        await other.goto(visit.url);
        await other.waitForSelector('html[data-gpu]');
        await (await other.$('#left-file')).uploadFile(...['left.png', 'right.png'].map((file) => join(scene('raw'), file)));
        await other.waitForFunction(() => document.querySelector('#warnings button'));
        await other.addScriptTag({ path: createRequire(import.meta.url).resolve('axe-core/axe.min.js') });
        for (const scheme of ['light', 'dark']) {
            await other.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
            const found = await other.evaluate(async () => (await window.axe.run()).violations.map(({ id, nodes }) => [id, nodes.map(({ target }) => target.join(' '))]));
            assert.deepEqual(found, [], scheme);
        }
        await other.click('#open-video');
        const found = await other.evaluate(async () => (await window.axe.run()).violations.map(({ id }) => id));
        assert.deepEqual(found, [], 'video');
        await other.close();
        await visit.tab.bringToFront();
    });

    it('fits on a phone', async () => {
        await visit.tab.setViewport({ width: 360, height: 740 });
        for (const view of [...VIEWS, 'stereo', 'surface']) {
            await visit.tab.click(`#tab-${view}`);
            const wide = await visit.tab.evaluate(() => document.documentElement.scrollWidth);
            assert.ok(wide <= 360, `${view}: ${wide}`);
            const hidden = await visit.tab.evaluate(() =>
                [...document.querySelectorAll('button, select, input:not([type=file])')]
                    .filter((e) => e.checkVisibility() && e.getBoundingClientRect().width > 0)
                    .filter((e) => e.getBoundingClientRect().right > 361 || e.getBoundingClientRect().left < -1)
                    .map((e) => e.id || e.textContent),
            );
            assert.deepEqual(hidden, [], view);
        }
        await visit.tab.setViewport({ width: 1280, height: 800 });
    });
});
