// What is known of the left view beforehand: lists of points and disparity maps beside a pair.
import assert from 'node:assert/strict';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { Visit } from './lib/visit.mjs';

const [LEFT, RIGHT, POINTS, TRUTH] = ['im0.png', 'im1.png', 'lidar.csv', 'disp0GT.pfm'].map((file) => join(scene('poster'), file));
const FLAGS = ['--method', 'fast', '--max-disparity', '31'];
const SETTINGS = { preset: 'fast', device: 'cpu', range: [0, 31] };
const VIEWS = [{ name: 'im0.png', path: LEFT }, { name: 'im1.png', path: RIGHT }];
const LIST = { name: 'lidar.csv', path: POINTS };

/** The disparities of a PFM file as a TIFF file of floats. */
function tiff(pfm) {
    const { width, height, at } = disparities(pfm);
    // Width, height, bits, no compression, black is 0, place of the pixels, samples, rows and bytes of the strip, and floats.
    const entries = [[256, width], [257, height], [258, 32], [259, 1], [262, 1], [273, 256], [277, 1], [278, height], [279, 4 * width * height], [339, 3]];
    const file = Buffer.alloc(256 + 4 * width * height);
    file.write('II*\0', 'latin1');
    file.writeUInt32LE(8, 4);
    file.writeUInt16LE(entries.length, 8);
    entries.forEach(([tag, value], i) => {
        file.writeUInt16LE(tag, 10 + 12 * i);
        file.writeUInt16LE(4, 12 + 12 * i);
        file.writeUInt32LE(1, 14 + 12 * i);
        file.writeUInt32LE(value, 18 + 12 * i);
    });
    for (let i = 0; i < width * height; i += 1) {
        file.writeFloatLE(at(i % width, Math.floor(i / width)), 256 + 4 * i);
    }
    return file;
}

describe('prior', () => {
    let visit;
    let folder;
    const at = (name) => join(folder, name);
    const without = native(LEFT, RIGHT, FLAGS).pfm;
    const byPoints = native(LEFT, RIGHT, [...FLAGS, '--prior', POINTS]).pfm;
    before(async () => {
        visit = await Visit.open();
        folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
    });
    after(async () => {
        rmSync(folder, { recursive: true, force: true });
        await visit.close();
    });

    const given = (...files) => visit.changed(() => visit.give('dropped', files));
    const hidden = (id) => visit.tab.$eval(id, (element) => element.hidden);

    /** The pair without anything else, and no message left. */
    async function fresh() {
        assert.equal(await given(...VIEWS), 'ready');
        assert.deepEqual([await visit.text('#prior-note'), await visit.text('#pair-problem'), await hidden('#forget-prior')], ['', '', true]);
    }

    /** Matches, and compares with a map of the program. */
    async function matches(pfm) {
        await visit.match(SETTINGS);
        assert.equal(difference((await visit.save('pfm')).bytes, pfm), undefined);
    }

    it('takes a list beside two images, says what it took and what it dropped, and forgets it', async () => {
        // Control: the list changes the map.
        assert.notEqual(difference(byPoints, without), undefined);
        assert.equal(await given(LIST, ...VIEWS), 'ready');
        assert.deepEqual(await visit.names(), ['im0.png', 'im1.png']);
        assert.equal(await visit.text('#prior-note'), 'lidar.csv: 720 points known beforehand');
        await matches(byPoints);
        assert.match(await visit.text('#prior-note'), /^lidar\.csv: 720 points known beforehand, [1-9]\d dropped$/);
        assert.equal(await visit.changed(() => visit.tab.click('#forget-prior')), 'ready');
        assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior'), await hidden('#add-prior')], ['', true, false]);
        await matches(without);
        // Also alone, or through its button.
        for (const give of [() => visit.give('dropped', [LIST]), () => visit.choose('prior', POINTS), () => visit.choose('left', LEFT, RIGHT, POINTS)]) {
            await fresh();
            assert.equal(await visit.changed(give), 'ready');
            assert.deepEqual([await hidden('#forget-prior'), await hidden('#add-prior')], [false, true]);
            await matches(byPoints);
        }
        // A calibration of the same pair leaves it, as does another worker; other images do not.
        assert.equal(await given({ name: 'calib.txt', path: join(scene('poster'), 'calib.txt') }), 'ready');
        await visit.holdCalls('match');
        const workers = await visit.countWorkers();
        await visit.set(SETTINGS);
        await visit.tab.click('#match');
        await visit.holds('match');
        // The worker never hears of the match, so that it is replaced.
        await visit.tab.click('#cancel');
        await visit.settled();
        await visit.release();
        assert.equal(await workers(), 1);
        await matches(byPoints);
        await fresh();
        await matches(without);
        await given(LIST);
        await visit.scene('thin');
        assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior')], ['', true]);
    });

    it('takes maps that are named or offered as such, and says where the images contradict them', async () => {
        await fresh();
        await visit.match(SETTINGS);
        for (const [output, name] of [['pfm', 'prior.pfm'], ['png', 'known.png']]) {
            writeFileSync(at(name), (await visit.save(output)).bytes);
        }
        writeFileSync(at('lidar.tif'), tiff(readFileSync(at('prior.pfm'))));
        for (const name of ['prior.pfm', 'known.png', 'lidar.tif']) {
            const { pfm } = native(LEFT, RIGHT, [...FLAGS, '--prior', at(name)]);
            assert.notEqual(difference(pfm, without), undefined, 'control: the map changes the map');
            assert.equal(await given(...VIEWS, { name, path: at(name) }), 'ready');
            assert.equal(await visit.text('#prior-note'), `${name}: 43,200 pixels known beforehand`);
            await matches(pfm);
            assert.equal(await visit.text('#prior-note'), `${name}: 43,200 pixels known beforehand`);
            assert.doesNotMatch(await visit.text('#warnings'), /prior/);
            await fresh();
            assert.equal(await given({ name, path: at(name) }), 'ready');
            await matches(pfm);
        }
        // A map without such a name is a view, unless it comes by the button.
        await fresh();
        copyFileSync(at('prior.pfm'), at('map.pfm'));
        assert.equal(await given({ name: 'map.pfm', path: at('map.pfm') }), 'empty');
        await fresh();
        assert.equal(await visit.changed(() => visit.choose('prior', at('map.pfm'))), 'ready');
        assert.match(await visit.text('#prior-note'), /^map\.pfm: 43,200 pixels/);
        // A list of another scene, in which all is far away.
        const lines = Array.from({ length: 40 * 30 }, (_, i) => `${6 * (i % 40)},${6 * Math.floor(i / 40)},2`);
        writeFileSync(at('other.txt'), lines.join('\n'));
        await fresh();
        assert.equal(await given({ name: 'other.txt', path: at('other.txt') }), 'ready');
        await visit.match(SETTINGS);
        assert.equal(await visit.text('#prior-note'), 'other.txt: 1,200 points known beforehand, 0 dropped');
        assert.match(await visit.text('#warnings'), /The images contradict the prior, so it was not used: check that it is of this scene/);
        assert.equal(difference((await visit.save('pfm')).bytes, without), undefined);
        // The truth in a folder of a benchmark stays unused.
        assert.equal(await given({ folder: 'poster', files: [...VIEWS, { name: 'disp0GT.pfm', path: TRUTH }] }), 'ready');
        assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior')], ['', true]);
    });

    it('never takes a photo, and refuses what does not fit in one line', async () => {
        await fresh();
        const before = await visit.names();
        /** What the page says to files that it takes nothing of. */
        const refused = async (files, pattern) => {
            await visit.give('dropped', files);
            await visit.says('#pair-problem', pattern);
            assert.deepEqual([await visit.names(), await hidden('#forget-prior')], [before, true]);
        };
        for (const name of ['third.png', 'known third.png']) {
            const views = [{ name: 'a.png', path: LEFT }, { name: 'b.png', path: RIGHT }];
            await refused([...views, { name, path: RIGHT }], /^These are 3 files\. Take two views, and a calibration if you have one\.$/);
        }
        await refused([LIST, { ...LIST, name: 'more.csv' }], /^lidar\.csv and more\.csv are both of what is known: give one of them\.$/);
        /** Reads the pair without the file, and says why. */
        const unused = async (give, pattern) => {
            assert.equal(await visit.changed(give), 'ready');
            const said = await visit.text('#pair-problem');
            assert.match(said, pattern);
            assert.ok(!said.includes('\n'));
            assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior'), await hidden('#add-prior')], ['', true, false]);
        };
        const list = (text) => {
            writeFileSync(at('list.csv'), text);
            return () => visit.give('dropped', [{ name: 'list.csv', path: at('list.csv') }]);
        };
        await unused(() => visit.choose('prior', LEFT), /^cannot read im0\.png: has more than one channel; disparity maps are \.pfm/);
        await unused(() => visit.choose('prior', join(scene('mixed'), 'disp0GT.pfm')), /^disp0GT\.pfm: it has 320 x 240 pixels and the left view 240 x 180: give a map of that size$/);
        await unused(list('1,2,3\n1,2\n'), /^list\.csv: line 2: not x,y,disparity or x,y,disparity,sigma in pixels$/);
        await unused(list('x,y,disparity\n'), /^list\.csv: there is no point$/);
        await unused(list('900,2,3\n'), /^list\.csv: none of the 1 points of the prior lies inside the left view of 240 x 180 pixels$/);
        await matches(without);
        // Without a pair there is nothing that it is of.
        assert.equal(await given(VIEWS[0]), 'empty');
        await visit.give('dropped', [LIST]);
        await visit.says('#pair-problem', /^Give lidar\.csv once both views are there: it is of the left one\.$/);
        await fresh();
    });
});
