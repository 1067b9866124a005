// What is known of the left view beforehand: lists of points, point clouds, and maps of disparities or depths beside a pair.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { PROGRAM, difference, native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { Visit } from './lib/visit.mjs';

const [LEFT, RIGHT, POINTS, TRUTH] = ['im0.png', 'im1.png', 'lidar.csv', 'disp0GT.pfm'].map((file) => join(scene('poster'), file));
const FLAGS = ['--method', 'fast', '--max-disparity', '31'];
const SETTINGS = { preset: 'fast', device: 'cpu', range: [0, 31] };
const VIEWS = [{ name: 'im0.png', path: LEFT }, { name: 'im1.png', path: RIGHT }];
const CALIBRATION = { name: 'calib.txt', path: join(scene('poster'), 'calib.txt') };
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

/** Points of a binary PLY file of the program, which has floats x, y, z first and 19 bytes for each point. */
function points(ply) {
    const start = ply.indexOf('end_header\n') + 'end_header\n'.length;
    return Array.from({ length: (ply.length - start) / 19 }, (_, i) => [0, 4, 8].map((axis) => ply.readFloatLE(start + 19 * i + axis)));
}

/** A PLY file of these points, with the axes as `type` in this `format`. */
function ply(all, format, type) {
    const header = `ply\nformat ${format} 1.0\nelement vertex ${all.length}\n${['x', 'y', 'z'].map((axis) => `property ${type} ${axis}\n`).join('')}end_header\n`;
    if (format === 'ascii') {
        return Buffer.from(`${header}${all.map((point) => point.join(' ')).join('\n')}\n`);
    }
    const size = type === 'double' ? 8 : 4;
    const bytes = Buffer.alloc(size * 3 * all.length);
    const write = bytes[`write${type === 'double' ? 'Double' : 'Float'}${format.endsWith('little_endian') ? 'LE' : 'BE'}`].bind(bytes);
    all.flat().forEach((value, i) => write(value, size * i));
    return Buffer.concat([Buffer.from(header), bytes]);
}

/** An array of NumPy with the values of a PFM file. */
function npy(pfm) {
    const { width, height, at } = disparities(pfm);
    const header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${height}, ${width}), }`.padEnd(117) + '\n';
    const file = Buffer.alloc(128 + 4 * width * height);
    file.write('\x93NUMPY\x01\x00', 'latin1');
    file.writeUInt16LE(118, 8);
    file.write(header, 10, 'latin1');
    for (let i = 0; i < width * height; i += 1) {
        file.writeFloatLE(at(i % width, Math.floor(i / width)), 128 + 4 * i);
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
        assert.equal(await given(...VIEWS), 'done');
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
        assert.equal(await given(LIST, ...VIEWS), 'done');
        assert.deepEqual(await visit.names(), ['im0.png', 'im1.png']);
        assert.match(await visit.text('#prior-note'), /^lidar\.csv: 720 points known beforehand, [1-9]\d dropped$/);
        await matches(byPoints);
        assert.equal(await visit.changed(() => visit.tab.click('#forget-prior')), 'done');
        assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior'), await hidden('#add-prior')], ['', true, false]);
        await matches(without);
        // Also alone, or through its button.
        for (const give of [() => visit.give('dropped', [LIST]), () => visit.choose('prior', POINTS), () => visit.choose('left', LEFT, RIGHT, POINTS)]) {
            await fresh();
            assert.equal(await visit.changed(give), 'done');
            assert.deepEqual([await hidden('#forget-prior'), await hidden('#add-prior')], [false, true]);
            await matches(byPoints);
        }
        // A calibration of the same pair leaves it, as does another worker; other images do not.
        assert.equal(await given(CALIBRATION), 'done');
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
            assert.equal(await given(...VIEWS, { name, path: at(name) }), 'done');
            assert.equal(await visit.text('#prior-note'), `${name}: 43,200 pixels known beforehand`);
            await matches(pfm);
            assert.equal(await visit.text('#prior-note'), `${name}: 43,200 pixels known beforehand`);
            assert.doesNotMatch(await visit.text('#warnings'), /prior/);
            await fresh();
            assert.equal(await given({ name, path: at(name) }), 'done');
            await matches(pfm);
        }
        // A map without such a name is a view, unless it comes by the button.
        await fresh();
        copyFileSync(at('prior.pfm'), at('map.pfm'));
        assert.equal(await given({ name: 'map.pfm', path: at('map.pfm') }), 'empty');
        await fresh();
        assert.equal(await visit.changed(() => visit.choose('prior', at('map.pfm'))), 'done');
        assert.match(await visit.text('#prior-note'), /^map\.pfm: 43,200 pixels/);
        // A list of another scene, in which all is far away.
        const lines = Array.from({ length: 40 * 30 }, (_, i) => `${6 * (i % 40)},${6 * Math.floor(i / 40)},2`);
        writeFileSync(at('other.txt'), lines.join('\n'));
        await fresh();
        assert.equal(await given({ name: 'other.txt', path: at('other.txt') }), 'done');
        await visit.match(SETTINGS);
        assert.equal(await visit.text('#prior-note'), 'other.txt: 1,200 points known beforehand, 0 dropped');
        assert.match(await visit.text('#warnings'), /The images contradict the prior, so it was not used: check that it is of this scene/);
        assert.equal(difference((await visit.save('pfm')).bytes, without), undefined);
        // The truth in a folder of a benchmark stays unused.
        assert.equal(await given({ folder: 'poster', files: [...VIEWS, { name: 'disp0GT.pfm', path: TRUTH }] }), 'done');
        assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior')], ['', true]);
    });

    /** Gives a file of a calibrated pair in every way: each time the map is that of the program with the flags `how` of the prior. */
    async function asTheProgram(name, note, { how = [], flags = [], calibration = CALIBRATION, views = VIEWS } = {}) {
        const [left, right] = views.map(({ path }) => path);
        const all = [...FLAGS, ...flags, '--calib', calibration.path];
        const { pfm } = native(left, right, [...all, '--prior', at(name), ...how]);
        assert.notEqual(difference(pfm, native(left, right, all).pfm), undefined, 'control: it changes the map');
        const known = { name, path: at(name) };
        for (const give of [
            () => given(...views, calibration, known),
            async () => [await given(...views, calibration), await given(known)].at(-1),
            async () => [await given(...views), await given(calibration, known)].at(-1),
            async () => [await given(...views, calibration), await visit.changed(() => visit.choose('prior', at(name)))].at(-1),
        ]) {
            assert.equal(await give(), 'done');
            assert.deepEqual([await visit.text('#pair-problem'), await hidden('#forget-prior')], ['', false]);
            assert.match(await visit.text('#prior-note'), note);
            await matches(pfm);
        }
    }

    it('takes point clouds and depths of a calibrated pair, as the program does', async () => {
        const depth = ['depth', TRUTH, at('truth.pfm'), '--calib', CALIBRATION.path, '--left', LEFT, '--also', 'points,depth,depth-mm', '--quiet'];
        execFileSync(PROGRAM, depth);
        copyFileSync(at('truth.depth.pfm'), at('depth.pfm'));
        const all = points(readFileSync(at('truth.points.ply'))).filter((_, i) => i % 97 === 0);
        for (const [name, format, type] of [['scan.ply', 'ascii', 'float'], ['b.ply', 'binary_little_endian', 'double'], ['c.PLY', 'binary_big_endian', 'float']]) {
            writeFileSync(at(name), ply(all, format, type));
            await asTheProgram(name, /: 4\d\d points known beforehand/);
        }
        writeFileSync(at('scan.xyz'), all.map((point) => point.join(' ')).join('\n'));
        await asTheProgram('scan.xyz', /^scan\.xyz: 4\d\d points known beforehand/);
        // Whole millimetres, and metres as floats, whatever the unit of the baseline.
        const text = readFileSync(CALIBRATION.path, 'utf8');
        writeFileSync(at('mm.txt'), text.replace(/baseline=.*/, 'baseline=163.6111111111111').replace('unit=m', 'unit=mm'));
        writeFileSync(at('depth.npy'), npy(readFileSync(at('depth.pfm'))));
        const millimetres = { name: 'mm.txt', path: at('mm.txt') };
        await asTheProgram('truth.depth-mm.png', /: 43,200 pixels known beforehand$/, { how: ['--prior-unit', 'mm'] });
        for (const name of ['depth.pfm', 'depth.npy']) {
            await asTheProgram(name, /: 43,200 pixels known beforehand$/, { how: ['--prior-unit', 'm'], calibration: millimetres });
        }
        // A map of a quarter of the size counts in all of it.
        const { at: of } = disparities(readFileSync(at('depth.pfm')));
        const small = Buffer.concat([Buffer.from('Pf\n120 90\n-1\n'), Buffer.alloc(4 * 120 * 90)]);
        for (let i = 0; i < 120 * 90; i += 1) {
            small.writeFloatLE(of(2 * (i % 120), 2 * (89 - Math.floor(i / 120))), small.length - 4 * 120 * 90 + 4 * i);
        }
        writeFileSync(at('small depth.pfm'), small);
        await asTheProgram('small depth.pfm', /: 43,200 pixels known beforehand$/, { how: ['--prior-unit', 'm'] });
        // Of raw images, points are in the frame of the camera that took the left one.
        const views = ['left', 'right'].map((side) => ({ name: `${side}.png`, path: join(scene('raw'), `${side}.png`) }));
        const cameras = { name: 'cameras.yml', path: join(scene('raw'), 'cameras.yml') };
        const rectify = ['--rectify', '--calib', cameras.path];
        const raw = native(...views.map(({ path }) => path), [...FLAGS, ...rectify], ['points']);
        writeFileSync(at('raw.ply'), ply(points(raw.points).filter((_, i) => i % 31 === 0), 'binary_little_endian', 'float'));
        await asTheProgram('raw.ply', /points known beforehand/, { flags: ['--rectify'], calibration: cameras, views });
    });

    it('says what clouds and depths lack', async () => {
        for (const [name, what] of [['scan.ply', 'points of the scene'], ['depth.pfm', 'depths']]) {
            await fresh();
            assert.equal(await given({ name, path: at(name) }), 'done');
            assert.equal(await visit.text('#pair-problem'), `${name}: it holds ${what}: give it with a calibration of the pair`);
            assert.deepEqual([await visit.text('#prior-note'), await hidden('#forget-prior')], ['', true]);
            await matches(without);
        }
        writeFileSync(at('calib.txt'), readFileSync(CALIBRATION.path, 'utf8').replace('unit=m', 'unit=unknown'));
        await fresh();
        assert.equal(await given({ name: 'calib.txt', path: at('calib.txt') }, { name: 'depth.pfm', path: at('depth.pfm') }), 'done');
        assert.match(await visit.text('#pair-problem'), /^depth\.pfm: it holds depths in millimetres or metres: add a line `unit=`/);
        // A calibration of other images is none of these.
        writeFileSync(at('calib.txt'), readFileSync(CALIBRATION.path, 'utf8').replace('height=180', 'height=100'));
        await fresh();
        assert.equal(await given({ name: 'calib.txt', path: at('calib.txt') }, { name: 'scan.ply', path: at('scan.ply') }), 'done');
        assert.match(await visit.text('#pair-problem'), /it is not used\. scan\.ply: it holds points of the scene: give it with a calibration/);
        writeFileSync(at('cut.ply'), readFileSync(at('truth.points.ply')).subarray(0, 900));
        await fresh();
        assert.equal(await given(CALIBRATION, { name: 'cut.ply', path: at('cut.ply') }), 'done');
        assert.match(await visit.text('#pair-problem'), /^cannot read cut\.ply: damaged: point \d+ of 43200 is missing$/);
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
            assert.equal(await visit.changed(give), 'done');
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
        writeFileSync(at('wide.pfm'), Buffer.concat([Buffer.from('Pf\n3 1\n-1\n'), Buffer.alloc(12)]));
        await unused(() => visit.choose('prior', at('wide.pfm')), /^wide\.pfm: it has 3 x 1 pixels and the left view 240 x 180; give a map of the left view, or of the same shape in another size$/);
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
