// Overlapping actions: names, map, range and files must always belong to the same pair.
import assert from 'node:assert/strict';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { Visit } from './lib/visit.mjs';

const views = (name) => ['im0.png', 'im1.png'].map((file) => join(scene(name), file));
const named = (paths, ...names) => paths.map((path, i) => ({ name: names[i], path }));
const THIN = named(views('thin'), 'my left.png', 'my right.png');
const RAW = named(['left.png', 'right.png', 'cameras.yml'].map((file) => join(scene('raw'), file)), 'raw left.png', 'raw right.png', 'cameras.yml');
const FAST = ['--method', 'fast'];
const RANGE = ['--max-disparity', '31'];
/** Longer than the page waits for a worker to stop. */
const PATIENCE = 3000;

describe('turns', () => {
    let visit;
    const expected = native(...views('thin'), [...FAST, ...RANGE]);
    const idle = (time) => new Promise((resolve) => setTimeout(resolve, time));
    const paste = (...files) => visit.give('pasted', files);
    const drop = (...files) => visit.give('dropped', files);
    /** The page holds the pair `thin` under these names, and saves its map under the first one. */
    async function holds(...names) {
        assert.deepEqual(await visit.names(), names);
        assert.equal(await visit.text('#notes'), '');
        await visit.match({ preset: 'fast', device: 'cpu', range: [0, 31] });
        const map = await visit.save('pfm');
        assert.equal(map.name, `${names[0].replace('.png', '').replaceAll(' ', '-')}-disparity.pfm`);
        assert.equal(difference(map.bytes, expected.pfm), undefined);
        await visit.set({ range: 'automatic' });
    }
    before(async () => {
        visit = await Visit.open();
        await visit.set({ preset: 'fast', device: 'cpu' });
    });
    after(() => visit.close());

    const meanwhile = [
        ['pasted text', () => paste()],
        ['three files', () => drop(...THIN, { ...THIN[0], name: 'third.png' })],
        ['what is no image', () => drop({ name: 'notes', path: join(scene('thin'), 'calib.txt') })],
        ['an empty folder', () => drop({ folder: 'none', files: [] })],
        ['a scene that cannot be loaded', () => visit.tab.evaluate(() => {
            const real = window.fetch;
            window.fetch = () => Promise.reject(new TypeError('no network'));
            document.querySelector('[data-scene=steep]').click();
            window.fetch = real;
        })],
    ];
    for (const [what, act] of meanwhile) {
        it(`reads a pair to its end that ${what} comes after`, async () => {
            await visit.scene('mixed');
            await visit.holdFiles();
            const state = await visit.changed(async () => {
                await drop(...THIN);
                await act();
                // Until then the page shows the scene, with its names and its map.
                assert.deepEqual(await visit.names(), ['mixed im0.png', 'mixed im1.png']);
                assert.equal((await visit.save('pfm')).name, 'mixed-disparity.pfm');
                await visit.release();
            });
            assert.equal(state, 'done');
            await holds('my left.png', 'my right.png');
        });
    }

    it('takes views that come one right after the other, however long each takes', async () => {
        await visit.scene('mixed');
        await visit.holdFiles(true);
        await visit.give('dropped', [THIN[0]], 'left');
        await visit.give('dropped', [THIN[1]], 'right');
        await idle(300);
        await visit.changed(() => visit.release());
        await visit.tab.waitForFunction(() => document.querySelector('#right .name').textContent !== 'choose a file');
        await visit.state('done');
        await holds('my left.png', 'my right.png');
    });

    it('swaps the pair that is read', async () => {
        await visit.scene('mixed');
        await visit.holdFiles();
        await visit.changed(async () => {
            await drop(...named(views('thin').reverse(), 'my left.png', 'my right.png'));
            await visit.tab.click('#swap');
            await visit.release();
        });
        await visit.tab.waitForFunction(() => document.querySelector('#left .name').textContent === 'my right.png');
        await visit.state('done');
        await holds('my right.png', 'my left.png');
    });

    it('takes the pair that came last, of two and of a scene', async () => {
        await visit.holdFiles();
        await drop(...RAW);
        await drop(...THIN);
        await visit.release();
        await visit.tab.waitForFunction(() => document.querySelector('#left .name').textContent === 'my left.png');
        await visit.state('done');
        await holds('my left.png', 'my right.png');
        // A scene that is still loading.
        await visit.tab.evaluate(() => {
            const real = window.fetch;
            const held = new Promise((resolve) => (window.release = resolve));
            window.fetch = async (...of) => {
                await held;
                return real(...of);
            };
            document.querySelector('[data-scene=steep]').click();
            window.fetch = real;
        });
        await visit.changed(() => drop(...THIN));
        await visit.release();
        await idle(300);
        await holds('my left.png', 'my right.png');
    });

    for (const call of ['pair', 'calibration', 'rectify', 'range', 'warnings']) {
        /** Gives a pair that is rectified by its calibration, and holds the call. */
        const hold = async () => {
            await visit.set({ range: 'automatic' });
            await visit.holdCalls(call);
            await drop(...RAW);
            await visit.holds(call);
        };
        const silent = async () => {
            assert.equal(await visit.text('#pair-problem'), '');
            assert.doesNotMatch(await visit.tab.$eval('#cameras-note', (note) => note.textContent), /cameras\.yml/);
        };

        for (const end of ['answered late', 'never answered']) {
            it(`leaves nothing of a pair that gives way to another, its call ${call} ${end}`, async () => {
                await hold();
                const state = await visit.changed(async () => {
                    await drop(...THIN);
                    await visit.tab.waitForFunction(() => document.querySelector('#left .name').textContent === 'my left.png');
                    // The page replaces a worker that does not reply.
                    await idle(end === 'never answered' ? PATIENCE : 0);
                    await visit.release();
                });
                assert.equal(state, 'done', await visit.text('#pair-problem'));
                await visit.says('#range-found', /by sparse matches$/);
                await silent();
                await holds('my left.png', 'my right.png');
            });
        }

        it(`leaves nothing of a pair that gives way to a single view at the call ${call}`, async () => {
            await hold();
            await visit.changed(async () => {
                await drop(THIN[0]);
                await visit.tab.waitForFunction(() => document.querySelector('#left .name').textContent === 'my left.png');
                await visit.release();
            });
            await idle(300);
            await visit.state('empty');
            assert.deepEqual(await visit.names(), ['my left.png', 'choose a file']);
            for (const said of ['#range-found', '#range-problem', '#warnings', '#notes', '#readout']) {
                assert.equal(await visit.text(said), '', said);
            }
            await silent();
            assert.equal(await visit.tab.$eval('#map', (map) => map.classList.contains('shown')), false);
        });
    }

    it('saves what was shown under the name that it had', async () => {
        await visit.scene('mixed');
        const map = await visit.save('pfm');
        await visit.holdCalls('file');
        const saved = visit.save('pfm');
        await visit.holds('file');
        await visit.changed(async () => {
            await drop(...THIN);
            await visit.release();
        });
        const { name, bytes } = await saved;
        assert.equal(name, 'mixed-disparity.pfm');
        assert.equal(difference(bytes, map.bytes), undefined);
        assert.equal(await visit.text('#save-problem'), '');
        await holds('my left.png', 'my right.png');
    });

    it('shows no points of a pair that has given way', async () => {
        await visit.scene('mixed');
        await visit.tab.click('#tab-surface');
        await visit.changed(() => drop(...THIN));
        await idle(300);
        // The scene has more points than the pair has pixels.
        const shown = () => visit.tab.$eval('#surface', ({ dataset }) => Number(dataset.points));
        assert.ok((await shown()) <= 240 * 180, `${await shown()} points`);
        await visit.scene('mixed');
        await visit.tab.waitForFunction(() => Number(document.getElementById('surface').dataset.points) > 240 * 180 || /no WebGL/.test(document.getElementById('surface-note').textContent));
        await visit.tab.click('#tab-disparity');
    });

    it('takes several changes of a pair that is matched, by the worker that it has', async () => {
        const workers = await visit.countWorkers();
        await visit.scene('mixed');
        await visit.set({ preset: 'paper' });
        await visit.begin();
        // Two changes at once, while the match is being stopped.
        await visit.changed(() => visit.tab.evaluate(() => {
            document.getElementById('swap').click();
            document.getElementById('swap').click();
        }));
        await visit.changed(() => drop(...THIN));
        await idle(PATIENCE);
        await visit.settled();
        assert.equal(await workers(), 0);
        await holds('my left.png', 'my right.png');
    });
});

describe('a page that opens', () => {
    let visit;
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    it('leaves the first scene to whom is faster, and waits for a GPU that takes its time', async () => {
        // Holds messages to the worker and file reads from the start.
        await visit.tab.evaluateOnNewDocument(() => {
            const { postMessage } = Worker.prototype;
            const { arrayBuffer } = Blob.prototype;
            const open = [];
            const read = new Promise((resolve) => (window.read = resolve));
            window.workers = 0;
            Worker.prototype.postMessage = function (message, ...rest) {
                window.workers += message.call === 'start' ? 1 : 0;
                if (message.call === 'open') {
                    open.push(() => postMessage.call(this, message, ...rest));
                } else {
                    postMessage.call(this, message, ...rest);
                }
            };
            window.open = () => open.forEach((send) => send());
            Blob.prototype.arrayBuffer = async function () {
                await read;
                return arrayBuffer.call(this);
            };
        });
        await visit.tab.goto(visit.url, { waitUntil: 'domcontentloaded' });
        await visit.give('dropped', THIN);
        await visit.tab.waitForSelector('html[data-version]');
        await new Promise((resolve) => setTimeout(resolve, 300));
        await visit.changed(() => visit.tab.evaluate(() => window.read()));
        assert.deepEqual(await visit.names(), ['my left.png', 'my right.png']);
        await visit.state('done');
        // The pair changes while the GPU is being opened.
        await visit.changed(() => visit.tab.click('#swap'));
        await new Promise((resolve) => setTimeout(resolve, PATIENCE));
        assert.deepEqual(await visit.names(), ['my right.png', 'my left.png']);
        await visit.tab.evaluate(() => window.open());
        await visit.tab.waitForSelector('html[data-gpu]');
        assert.equal(await visit.tab.evaluate(() => window.workers), 1);
        assert.match(await visit.text('#engine'), /^GPU: /);
        await visit.state('done');
    });
});
