// Warnings about a result and their remedies: they stay with the result, and a button applies them.
import assert from 'node:assert/strict';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { ROOT, scene } from './lib/paths.mjs';
import { BROWSER, Visit } from './lib/visit.mjs';

const { PNG } = createRequire(join(ROOT, 'web/package.json'))('pngjs');
const views = (name) => ['im0.png', 'im1.png'].map((file) => join(scene(name), file));
const RAW = ['left.png', 'right.png'].map((file) => join(scene('raw'), file));
const CAMERAS = join(scene('raw'), 'cameras.yml');
const FAST = ['--method', 'fast'];

describe('the first view', () => {
    let visit;
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    it('is the map of a scene, with what it is', async () => {
        assert.equal(await visit.tab.$eval('#app', (app) => app.dataset.state), 'done');
        assert.equal(await visit.tab.$eval('#map', (map) => map.dataset.shown), 'disparity');
        assert.match(await visit.text('#facts'), /^320 × 240 pixels · .*fast.*CPU path/);
        assert.match(await visit.says('#intro', /\w/), /rendered scene/);
        assert.equal(difference((await visit.save('pfm')).bytes, native(...views('mixed'), FAST).pfm), undefined);
    });

    it('takes no focus, and stays at its top', async () => {
        await visit.tab.setViewport({ width: 720, height: 450 });
        await visit.tab.reload();
        await visit.tab.waitForSelector('html[data-gpu]');
        assert.deepEqual(await visit.tab.evaluate(() => [scrollY, document.activeElement === document.body]), [0, true]);
        await visit.tab.setViewport({ width: 1280, height: 800 });
    });

    it('shows the map and the button in one screen', async () => {
        for (const [width, height] of [[1440, 900], [768, 1024], [360, 740]]) {
            await visit.tab.setViewport({ width, height });
            const seen = await visit.tab.evaluate(() => ['match', 'stage-box'].map((id) => {
                const { top, bottom } = document.getElementById(id).getBoundingClientRect();
                return top >= 0 && bottom <= innerHeight;
            }));
            assert.deepEqual(seen, [true, true], `${width} x ${height}`);
        }
        await visit.tab.setViewport({ width: 1280, height: 800 });
    });

    it('has links, and a version', async () => {
        assert.match(await visit.text('#version'), /^Version \d+\.\d+\.\d+$/);
        const licence = await visit.tab.evaluate(async () => (await fetch(document.querySelector('#about a').href)).text());
        assert.match(licence, /MIT License[^]*Apache License/);
        // Without an address of the source there is no link to it.
        const links = await visit.tab.$$eval('a', (all) => all.map((a) => a.getAttribute('href')));
        assert.ok(links.every((href) => /^(licence\.txt|https:)/.test(href)), links);
    });

    it('gives way to a view of one\'s own', async () => {
        assert.equal(await visit.changed(() => visit.choose('left', views('thin')[0])), 'empty');
        assert.equal(await visit.text('#right .name'), 'choose a file');
        assert.equal(await visit.tab.$eval('#intro', (intro) => intro.checkVisibility()), false);
    });
});

describe('remedies', () => {
    let visit;
    let folder;
    const click = (list, text) => visit.tab.evaluate((list, text) => {
        [...document.querySelectorAll(`${list} button`)].find((button) => button.textContent === text).click();
    }, list, text);
    /** Runs an action that matches again, and waits for the result. */
    const again = async (action) => {
        const before = await visit.tab.$eval('#app', (app) => app.dataset.took);
        await action();
        await visit.tab.waitForFunction((before) => document.getElementById('app').dataset.took !== before, {}, before);
        assert.equal(await visit.settled(), 'done', await visit.text('#problem'));
    };
    before(async () => {
        visit = await Visit.open();
        folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
        await visit.set({ preset: 'fast', device: 'cpu' });
    });
    after(async () => {
        rmSync(folder, { recursive: true, force: true });
        await visit.close();
    });

    it('swaps views that are swapped', async () => {
        const [left, right] = views('slanted');
        copyFileSync(right, join(folder, 'im0.png'));
        copyFileSync(left, join(folder, 'im1.png'));
        await visit.pair(folder);
        await visit.says('#warnings', /views seem to be swapped/);
        await visit.match({ range: 'automatic' });
        await visit.says('#warnings', /views seem to be swapped/);
        await again(() => click('#warnings', 'Swap the views'));
        assert.doesNotMatch(await visit.text('#warnings'), /swapped/);
        assert.equal(await visit.text('#left .name'), 'im1.png');
        assert.equal(difference((await visit.save('pfm')).bytes, native(join(folder, 'im1.png'), join(folder, 'im0.png'), FAST).pfm), undefined);
    });

    it('rectifies a pair by its matches where they are not on one row, and undoes it', async () => {
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW)), 'done');
        assert.match(await visit.text('#notes'), /Rectified by its own matches, without a scale: \d+ of \d+ matches agree/);
        assert.doesNotMatch(await visit.text('#warnings'), /not rectified/);
        assert.equal(await visit.text('#pair-problem'), '');
        assert.equal(difference((await visit.save('pfm')).bytes, native(...RAW, [...FAST, '--rectify']).pfm), undefined);
        assert.equal(await visit.changed(() => click('#notes', 'Undo rectification')), 'ready');
        assert.doesNotMatch(await visit.text('#notes'), /Rectified/);
        await visit.says('#warnings', /not rectified/);
        await visit.says('#range-problem', /^No depth range was found/);
        // Match leads to the button.
        await visit.tab.click('#match');
        await visit.tab.waitForFunction(() => document.activeElement.id === 'rectify');
        await again(() => click('#warnings', 'Rectify'));
        assert.match(await visit.text('#notes'), /Rectified by its own matches/);
    });

    it('rectifies a pair without a range before it asks for one, and swaps it as it is', async () => {
        await visit.set({ range: 'automatic' });
        const [left, right] = views('mixed');
        const from = PNG.sync.read(readFileSync(right));
        // Simulates a camera that was tilted between the views.
        const to = new PNG({ width: from.width, height: from.height });
        PNG.bitblt(from, to, 0, 60, from.width, from.height - 60, 0, 0);
        const [one, other] = ['by hand left.png', 'by hand right.png'].map((name) => join(folder, name));
        copyFileSync(left, one);
        writeFileSync(other, PNG.sync.write(to));
        assert.equal(await visit.changed(() => visit.choose('left', one, other)), 'done');
        assert.match(await visit.text('#notes'), /Rectified by its own matches/);
        assert.equal(await visit.tab.$eval('#no-range', (offer) => offer.checkVisibility()), false);
        assert.equal(await visit.text('#range-problem'), '');
        assert.equal(difference((await visit.save('pfm')).bytes, native(one, other, [...FAST, '--rectify']).pfm), undefined);
        // The same pair remains rectified.
        await visit.changed(() => visit.tab.click('#swap'));
        assert.match(await visit.text('#notes'), /Rectified by its own matches/);
        // Another pair is not rectified.
        await visit.pair(scene('mixed'));
        assert.equal(await visit.text('#notes'), '');
    });

    it('offers no rectification that has failed', async () => {
        await visit.set({ range: 'automatic' });
        const [one, other] = [views('thin')[0], views('steep')[1]];
        assert.equal(await visit.changed(() => visit.give('dropped', [one, other].map((path, i) => ({ name: `im${i}.png`, path })))), 'ready');
        await visit.says('#pair-problem', /cannot be rectified without a calibration/);
        await visit.says('#range-problem', /^No depth range was found/);
        assert.equal(await visit.tab.$eval('#no-range', (offer) => offer.checkVisibility()), false);
        await visit.match({ range: [0, 31] });
        const offered = () => visit.tab.$$eval('#warnings button, #notes button', (buttons) => buttons.map((button) => button.textContent));
        assert.ok(!(await offered()).includes('Rectify'), await visit.text('#warnings'));
        await visit.set({ range: 'automatic' });
        await visit.says('#range-problem', /No depth range was found/);
        assert.equal(await visit.tab.$eval('#no-range', (offer) => offer.checkVisibility()), false);
        // The failure concerned that pair.
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW)), 'done');
        assert.equal(await visit.text('#pair-problem'), '');
        assert.equal(await visit.changed(() => click('#notes', 'Undo rectification')), 'ready');
        assert.ok((await offered()).includes('Rectify'));
        // Also with a known range. The engine is given a pair that it cannot rectify.
        await visit.set({ range: [0, 31] });
        await visit.tab.evaluate(() => {
            const real = Worker.prototype.postMessage;
            Worker.prototype.postMessage = function (message, ...rest) {
                real.call(this, message.call === 'rectify' ? { ...message, args: [[{ name: 'none.yml', text: '?' }]] } : message, ...rest);
                Worker.prototype.postMessage = message.call === 'rectify' ? real : Worker.prototype.postMessage;
            };
        });
        await again(() => click('#warnings', 'Rectify'));
        assert.match(await visit.text('#pair-problem'), /\w/);
        assert.match(await visit.text('#warnings'), /not rectified/);
        assert.ok(!(await offered()).includes('Rectify'));
    });

    it('rectifies by a calibration of OpenCV, also one that comes before its pair', async () => {
        await visit.scene('mixed');
        await visit.choose('left', CAMERAS);
        await visit.says('#pair-note', /cameras\.yml is kept/);
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW)), 'done');
        await visit.says('#notes', /Rectified by cameras\.yml/);
        await visit.match({ range: 'automatic' });
        await visit.says('#notes', /Rectified by cameras\.yml/);
        assert.equal(difference((await visit.save('pfm')).bytes, native(...RAW, [...FAST, '--rectify', '--calib', CAMERAS]).pfm), undefined);
        assert.match(await visit.tab.$eval('#cameras-note', (note) => note.textContent), /cameras\.yml/);
    });

    it('joins the files of a calibration that come one by one', async () => {
        const entries = readFileSync(CAMERAS, 'utf8').replace(/^[^]*?---\n/, '').split(/\n(?=\w)/);
        const write = (name, lines) => writeFileSync(join(folder, name), `%YAML:1.0\n---\n${lines.join('\n')}\n`);
        const of = (pattern) => entries.filter((entry) => pattern.test(entry));
        write('lenses.yml', of(/^(imageSize|unit|[KD]\d)/));
        for (const [name, number] of [['lens left.yml', '1'], ['lens right.yml', '2']]) {
            write(name, ['imageSize: [ 240, 180 ]', ...of(new RegExp(`^[KD]${number}`)).map((entry) => entry.replace(number, ''))]);
        }
        write('pose.yml', of(/^(unit|[RT]):/));
        write('other.yml', ['unit: m']);
        const expected = native(...RAW, [...FAST, '--rectify', '--calib', CAMERAS]);
        const give = (name) => visit.changed(() => visit.choose('left', join(folder, name)));
        const rectified = async (by) => {
            await visit.says('#notes', by);
            assert.equal(await visit.text('#pair-problem'), '');
            await visit.match({ range: 'automatic' });
            assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        };
        for (const order of [['lenses.yml', 'pose.yml'], ['pose.yml', 'lenses.yml'], ['other.yml', 'pose.yml', 'lenses.yml']]) {
            assert.equal(await visit.changed(() => visit.choose('left', ...RAW)), 'done');
            for (const name of order.slice(0, -1)) {
                assert.equal(await give(name), 'ready');
                await visit.says('#pair-problem', /\w/);
            }
            assert.equal(await give(order.at(-1)), 'done');
            await rectified(/Rectified by (lenses\.yml, pose\.yml|pose\.yml, lenses\.yml)\b/);
        }
        // Three of them, the lens of the right camera first, and before their pair.
        await visit.scene('mixed');
        for (const name of ['pose.yml', 'lens right.yml', 'lens left.yml']) {
            await visit.choose('left', join(folder, name));
            await visit.says('#pair-note', new RegExp(name.replace('.', '\\.')));
        }
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW)), 'done');
        await rectified(/Rectified by lens left\.yml, pose\.yml, lens right\.yml/);
        // A whole one takes the place of all.
        assert.equal(await visit.changed(() => visit.choose('left', CAMERAS)), 'done');
        await rectified(/Rectified by cameras\.yml/);
    });

    it('scales a calibration to images of its aspect, and names one of another', async () => {
        const text = readFileSync(CAMERAS, 'utf8');
        const sized = (name, size) => writeFileSync(join(folder, name), text.replace('[ 240, 180 ]', size));
        sized('larger.yml', '[ 480, 360 ]');
        sized('wider.yml', '[ 320, 180 ]');
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW, join(folder, 'larger.yml'))), 'done');
        await visit.says('#notes', /Rectified by larger\.yml.*larger\.yml: is for images of 480 x 360.*count as the same, scaled/i);
        assert.equal(await visit.changed(() => visit.choose('left', ...RAW, join(folder, 'wider.yml'))), 'ready');
        await visit.says('#pair-problem', /wider\.yml: .*320 x 180.*240 x 180/);
    });

    it('keeps a calibration that comes before its pair', async () => {
        assert.equal(await visit.scene('mixed'), 'done');
        await visit.choose('left', join(scene('thin'), 'calib.txt'));
        await visit.says('#pair-note', /calib\.txt is kept/);
        // A scene has its own calibration.
        assert.equal(await visit.scene('slanted'), 'done');
        await visit.pair(scene('thin'));
        await visit.says('#range-found', /^0 to 31 px, by calib\.txt$/);
        // It belongs to that pair, not to the next one.
        await visit.pair(scene('slanted'));
        await visit.says('#range-found', /by sparse matches$/);
    });

    it('widens a range', async () => {
        await visit.pair(scene('mixed'));
        await visit.match({ range: [0, 19] });
        await visit.says('#warnings', /cuts off part of the scene/);
        await again(() => click('#warnings', 'Widen the range'));
        assert.match(await visit.text('#facts'), /range 0 to 29/);
        // Also during another match, which is stopped. The range is kept for this pair.
        await visit.match({ range: [0, 19] });
        await visit.set({ preset: 'paper' });
        await visit.begin();
        await visit.set({ preset: 'fast' });
        await click('#warnings', 'Widen the range');
        await visit.tab.waitForFunction(() => /range 0 to 29/.test(document.getElementById('facts').textContent));
        assert.equal(await visit.state('done'), 'done');
        assert.equal(await visit.text('#problem'), '');
        assert.match(await visit.text('#facts'), /fast/);
        await visit.pair(scene('mixed'));
        assert.equal(await visit.tab.$eval('input[value=automatic]', (input) => input.checked), true);
    });

    it('says that both images are the same, as long as the map is there', async () => {
        const [left] = views('mixed');
        for (const name of ['im0.png', 'im1.png']) {
            copyFileSync(left, join(folder, name));
        }
        await visit.pair(folder);
        await visit.match({ range: [0, 31] });
        await visit.says('#warnings', /two images are the same/);
    });

    it('says what was corrected', async () => {
        await visit.pair(scene('rows'), join(scene('rows'), 'calib.txt'));
        await visit.match({ preset: 'default', range: 'automatic' });
        await visit.says('#notes', /right view is moved (up|down) by \d\.\d\d px/);
    });

    it('matches at half the size', async () => {
        await visit.pair(scene('mixed'), join(scene('mixed'), 'calib.txt'));
        await visit.tab.select('#size', 'half');
        await visit.match({ preset: 'default' });
        await visit.tab.select('#size', 'automatic');
        assert.match(await visit.text('#facts'), /at half size/);
        assert.equal(difference((await visit.save('pfm')).bytes, native(...views('mixed'), ['--set', 'match-size=half']).pfm), undefined);
    });

    for (const device of ['cpu', 'gpu']) {
        it(`says how far a match has come, in words, on the ${device}`, async () => {
            await visit.pair(scene('mixed'), join(scene('mixed'), 'calib.txt'));
            await visit.set({ preset: 'default', device });
            const seen = await visit.tab.evaluate(async () => {
                const [app, bar, stage] = ['app', 'progress', 'stage'].map((id) => document.getElementById(id));
                const begun = performance.now();
                const all = [];
                document.getElementById('match').click();
                while (app.dataset.state !== 'done') {
                    await new Promise((resolve) => setTimeout(resolve, 20));
                    if (app.dataset.state === 'matching') {
                        all.push({ time: performance.now() - begun, done: bar.value, text: stage.textContent });
                    }
                }
                return all;
            });
            const end = seen.at(-1).time;
            const texts = [...new Set(seen.map(({ text }) => text))];
            assert.ok(texts.some((text) => /^Matching · \d+ %/.test(text)), texts.join('; '));
            assert.ok(texts.every((text) => /^(Getting ready|(Preparing the views|Matching|Cleaning up) · \d+ %( · .* left)?)$/.test(text)), texts.join('; '));
            const half = seen.findLast(({ time }) => time < end / 2);
            // Firefox reports immediately that a device is done.
            if (device === 'cpu' || BROWSER === 'chromium') {
                assert.ok((half?.done ?? 0) < 0.9, `half of the time: ${JSON.stringify(half)}`);
            }
        });
    }

    it('keeps the last map until there is another, also after Cancel', async () => {
        await visit.match({ preset: 'fast', device: 'cpu' });
        const before = await visit.save('pfm');
        await visit.set({ preset: 'paper' });
        await visit.begin();
        assert.equal(await visit.tab.$eval('#map', (map) => map.dataset.shown), 'disparity');
        await visit.tab.click('#cancel');
        await visit.says('#problem', /^Stopped\.$/);
        assert.equal(await visit.settled(), 'done');
        assert.equal(difference((await visit.save('pfm')).bytes, before.bytes), undefined);
    });
});
