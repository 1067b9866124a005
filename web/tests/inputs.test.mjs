// Ways to give views, and messages about unusable files. The page must keep working after each.
import assert from 'node:assert/strict';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { Visit } from './lib/visit.mjs';

const [LEFT, RIGHT] = ['im0.png', 'im1.png'].map((file) => join(scene('thin'), file));

describe('inputs', () => {
    let visit;
    let folder;
    const at = (name) => join(folder, name);
    const expected = native(LEFT, RIGHT, ['--method', 'fast']);
    before(async () => {
        visit = await Visit.open();
        folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
    });
    after(async () => {
        rmSync(folder, { recursive: true, force: true });
        await visit.close();
    });

    /** A good pair still matches, and earlier messages are gone. */
    async function works() {
        await visit.set({ range: 'automatic' });
        await visit.pair(scene('thin'), join(scene('thin'), 'calib.txt'));
        for (const problem of ['#left-problem', '#right-problem', '#pair-problem', '#problem', '#range-problem']) {
            assert.equal(await visit.text(problem), '', problem);
        }
        await visit.match({ preset: 'fast', device: 'cpu' });
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
    }

    it('tells left from right by the names', async () => {
        const names = [
            ['left.png', 'right.png'],
            ['im0.png', 'im1.png'],
            ['im2.png', 'im6.png'],
            ['view9.png', 'view10.png'],
            ['scene_L.png', 'scene_R.png'],
            ['rightmost-l.png', 'rightmost-r.png'],
            ['imgL.png', 'imgR.png'],
            ['leftImage.png', 'rightImage.png'],
            ['000010_0.png', '000010_1.png'],
            // Numbers of any length; words take precedence, as the right view may have been taken first.
            ['1403636579763555583.png', '1403636579763555584.png'],
            ['cam 2 left.png', 'cam 1 right.png'],
            ['photo.jpg', 'photo2.jpg'],
            ['im01_l.png', 'im1_r.png'],
        ];
        for (const [left, right] of names) {
            copyFileSync(LEFT, at(left));
            copyFileSync(RIGHT, at(right));
            for (const order of [[left, right], [right, left]]) {
                assert.equal(await visit.changed(() => visit.choose('left', ...order.map(at))), 'done');
                assert.deepEqual(await visit.names(), [left, right]);
            }
        }
    });

    it('keeps the order of files whose names do not tell', async () => {
        const names = [['pear.png', 'apple.png'], ['view.png', 'view.PNG'], ['01.png', '1.png']];
        for (const pair of names) {
            for (const order of [pair, [...pair].reverse()]) {
                // Both files are the same, so that neither order is better.
                const files = order.map((name) => ({ name, path: LEFT }));
                assert.equal(await visit.changed(() => visit.give('dropped', files)), 'done');
                assert.deepEqual(await visit.names(), order);
            }
        }
    });

    it('begins a new pair with one new image, and tells views that come one by one from each other', async () => {
        await works();
        for (const way of ['dropped', 'pasted']) {
            await visit.pair(scene('thin'), join(scene('thin'), 'calib.txt'));
            assert.equal(await visit.changed(() => visit.give(way, [{ name: 'my right.png', path: RIGHT }])), 'empty');
            assert.deepEqual(await visit.names(), ['my right.png', 'choose a file']);
            assert.match(await visit.text('#pair-note'), /my right\.png begins a new pair/);
            assert.equal(await visit.changed(() => visit.give(way, [{ name: 'my left.png', path: LEFT }])), 'done');
            assert.deepEqual(await visit.names(), ['my left.png', 'my right.png']);
            assert.equal(await visit.text('#pair-note'), '');
            // The calibration belonged to the previous pair.
            await visit.says('#range-found', /by sparse matches$/);
        }
        await visit.match({ preset: 'fast', device: 'cpu', range: [0, 31] });
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        await works();
    });

    it('says which view stays where the other one is chosen anew, and keeps their calibration no longer than one of them', async () => {
        await visit.set({ range: 'automatic' });
        await visit.pair(scene('thin'), join(scene('thin'), 'calib.txt'));
        copyFileSync(LEFT, at('new left.png'));
        copyFileSync(RIGHT, at('new right.png'));
        assert.equal(await visit.changed(() => visit.choose('left', at('new left.png'))), 'done');
        assert.equal(await visit.text('#pair-note'), 'im1.png is still the right view, and calib.txt the calibration.');
        assert.match(await visit.text('#range-found'), /by calib\.txt$/);
        assert.equal(await visit.changed(() => visit.choose('right', at('new right.png'))), 'done');
        assert.equal(await visit.text('#pair-note'), '');
        assert.match(await visit.text('#range-found'), /by sparse matches$/);
        // A slot takes precedence over the names.
        await visit.changed(() => visit.give('dropped', [{ name: 'my right.png', path: LEFT }], 'left'));
        assert.deepEqual(await visit.names(), ['my right.png', 'new right.png']);
        await visit.changed(() => visit.give('dropped', [{ name: 'my left.png', path: RIGHT }], 'right'));
        assert.deepEqual(await visit.names(), ['my right.png', 'my left.png']);
        await works();
    });

    it('leaves all as it is where it takes nothing', async () => {
        await works();
        const [left, right] = [LEFT, RIGHT].map((path, i) => ({ name: `view ${i}.png`, path }));
        writeFileSync(at('notes'), 'These are no pixels.');
        const notes = { name: 'notes', path: at('notes') };
        writeFileSync(at('photo'), Buffer.concat([Buffer.from([0, 0, 0, 24]), Buffer.from('ftypheic\0\0\0\0mif1heic', 'latin1')]));
        const photo = { name: 'IMG_1.HEIC', path: at('photo') };
        const refused = [
            ['dropped', [left, right, { ...right, name: 'third.png' }], /3 files/],
            ['pasted', [left, right, { ...right, name: 'third.png' }], /3 files/],
            ['dropped', [notes], /notes is not an image/],
            ['dropped', [photo], /IMG_1\.HEIC is a HEIC photo.*JPEG/],
            ['pasted', [notes], /notes is not an image/],
            ['dropped', [left, notes], /notes is not an image/],
            ['dropped', [{ ...notes, name: 'README.txt' }], /no view and no calibration in README\.txt/],
            ['dropped', [{ folder: 'none', files: [] }], /no view and no calibration in none/],
            ['dropped', [{ folder: 'nothing', files: [{ ...notes, name: '.DS_Store' }, { ...notes, name: 'desktop.ini' }] }], /no view and no calibration in nothing/],
            ['dropped', [{ folder: 'one', files: [] }, { folder: 'other', files: [] }], /no view and no calibration in what was dropped/],
            ['dropped', [{ folder: 'lost', files: [left, { name: 'im1.png' }] }], /What was dropped cannot be read: it is gone/],
            ['pasted', [], /^$/],
        ];
        const turn = () => visit.tab.$eval('#app', (app) => app.dataset.turn);
        const before = await turn();
        for (const [way, files, words] of refused) {
            await visit.tab.evaluate(() => (document.getElementById('pair-problem').textContent = ''));
            await visit.give(way, files);
            if (files.length > 0) {
                await visit.says('#pair-problem', words);
            }
            assert.deepEqual([await visit.names(), await turn()], [['im0.png', 'im1.png'], before], `${words}`);
        }
        // At its slot, if it was dropped on one.
        await visit.give('dropped', [notes], 'right');
        await visit.says('#right-problem', /notes is not an image/);
        assert.equal(await visit.tab.$eval('#app', (app) => app.dataset.state), 'done');
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        await works();
    });

    it('takes the views of folders', async () => {
        await visit.set({ range: 'automatic' });
        const [left, right, calib] = [[LEFT, 'b10.png'], [RIGHT, 'b9.png'], [join(scene('thin'), 'calib.txt'), 'calib.txt']].map(([path, name]) => ({ path, name }));
        // In any order, with files that operating systems create.
        const files = [{ name: 'Thumbs.db', path: LEFT }, right, calib, { name: '.hidden.png', path: LEFT }, left];
        assert.equal(await visit.changed(() => visit.give('dropped', [{ folder: 'Some', files }])), 'done');
        assert.deepEqual(await visit.names(), ['b9.png', 'b10.png']);
        await visit.says('#range-found', /by calib\.txt$/);
        // Each view in its own folder, with the same name.
        const two = [LEFT, RIGHT].map((path, i) => ({ folder: `image_${i}`, files: [{ name: '000010.png', path }] }));
        assert.equal(await visit.changed(() => visit.give('dropped', two)), 'done');
        await visit.match({ preset: 'fast', device: 'cpu', range: [0, 31] });
        const map = await visit.save('pfm');
        assert.equal(map.name, '000010-disparity.pfm');
        assert.equal(difference(map.bytes, expected.pfm), undefined);
        // A benchmark: its folders have many frames, and not all of them views.
        const frames = (path, ...names) => names.map((name) => ({ name, path }));
        const deeper = [
            { folder: 'image_3', files: frames(RIGHT, '000001_10.png', '000000_11.png', '000000_10.png') },
            { folder: 'disp_occ_0', files: frames(RIGHT, '000000_10.png') },
            { folder: 'image_2', files: frames(LEFT, '000000_10.png', '000001_10.png') },
        ];
        assert.equal(await visit.changed(() => visit.give('dropped', [{ folder: 'kitti', files: [{ folder: 'training', files: deeper }] }])), 'done');
        assert.deepEqual(await visit.names(), ['000000_10.png', '000000_10.png']);
        await visit.match({ preset: 'fast', device: 'cpu', range: [0, 31] });
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        // One folder in another.
        assert.equal(await visit.changed(() => visit.give('dropped', [{ folder: 'all', files: [{ folder: 'Some', files }] }])), 'done');
        assert.deepEqual(await visit.names(), ['b9.png', 'b10.png']);
        await works();
    });

    it('keeps no range of another pair, but one that was typed in for its size', async () => {
        const given = () => visit.tab.$eval('input[value=given]', (input) => input.checked);
        await visit.set({ range: 'automatic' });
        await visit.pair(scene('thin'));
        await visit.set({ range: [0, 19] });
        await visit.changed(() => visit.tab.click('#swap'));
        assert.equal(await given(), true);
        await visit.pair(scene('thin'));
        assert.equal(await given(), true);
        await visit.pair(scene('mixed'));
        assert.equal(await given(), false);
        await works();
    });

    it('swaps the views', async () => {
        await visit.pair(scene('thin'));
        assert.equal(await visit.changed(() => visit.tab.click('#swap')), 'done');
        assert.deepEqual(await visit.names(), ['im1.png', 'im0.png']);
        await visit.match({ preset: 'fast', device: 'cpu', range: [-31, 0] });
        const swapped = native(RIGHT, LEFT, ['--method', 'fast', '--min-disparity', '-31', '--max-disparity', '0']);
        assert.equal(difference((await visit.save('pfm')).bytes, swapped.pfm), undefined);
        // Negative disparities do not fit into PNG.
        await visit.tab.click('#downloads [data-output=png]');
        await visit.says('#save-problem', /\w/);
        await works();
    });

    for (const way of ['dropped', 'pasted']) {
        it(`takes ${way} files`, async () => {
            const files = [RIGHT, LEFT].map((path, i) => ({ name: `im${1 - i}.png`, path }));
            assert.equal(await visit.changed(() => visit.give(way, files)), 'done');
            assert.deepEqual(await visit.names(), ['im0.png', 'im1.png']);
            await works();
        });
    }

    it('opens a rendered scene, and matches it', async () => {
        await visit.set({ preset: 'fast', device: 'cpu', range: 'automatic' });
        assert.equal(await visit.scene('thin'), 'done');
        await visit.says('#range-found', /^0 to 31 px, by calib.txt$/);
        const map = await visit.save('pfm');
        assert.equal(map.name, 'thin-disparity.pfm');
        assert.equal(difference(map.bytes, expected.pfm), undefined);
    });

    it('asks for the view that is missing', async () => {
        const other = await visit.browser.newPage();
        await other.goto(visit.url);
        await other.waitForSelector('html[data-gpu]');
        await (await other.$('#right-file')).uploadFile(RIGHT);
        await other.waitForSelector('#app[data-state=empty]');
        await other.click('#match');
        await other.waitForFunction(() => /Choose the left view/.test(document.getElementById('left-problem').textContent));
        assert.equal(await other.$eval('#right-problem', (p) => p.textContent), '');
        await (await other.$('#left-file')).uploadFile(LEFT);
        await other.waitForFunction(() => document.getElementById('left-problem').textContent === '');
        await other.waitForSelector('#app[data-state=done]');
        await other.close();
        // Pages in the background draw no frames.
        await visit.tab.bringToFront();
    });

    it('says that a file is no image, at its slot', async () => {
        writeFileSync(at('notes.png'), 'These are no pixels.');
        await visit.choose('right', at('notes.png'));
        await visit.says('#right-problem', /notes\.png is not an image/);
        assert.equal(await visit.text('#left-problem'), '');
        await works();
    });

    it('says that a file is cut off, at its slot', async () => {
        writeFileSync(at('half.png'), readFileSync(LEFT).subarray(0, 20_000));
        await visit.choose('left', at('half.png'));
        await visit.says('#left-problem', /half\.png/);
        await works();
    });

    it('says that the sizes differ', async () => {
        await visit.choose('right', join(scene('mixed'), 'im1.png'));
        await visit.says('#pair-problem', /240 × 180.*320 × 240/);
        await works();
    });

    it('refuses what the memory of a page cannot hold', async () => {
        const huge = Buffer.from(readFileSync(LEFT));
        huge.writeUInt32BE(30_000, 16);
        huge.writeUInt32BE(20_000, 20);
        for (const name of ['huge0.png', 'huge1.png']) {
            writeFileSync(at(name), huge);
        }
        await visit.choose('left', at('huge0.png'), at('huge1.png'));
        await visit.says('#pair-problem', /30,000 × 20,000.*GiB/);
        await works();
    });

    it('refuses a crowd', async () => {
        copyFileSync(LEFT, at('another.png'));
        await visit.choose('left', at('left.png'), at('right.png'), at('another.png'));
        await visit.says('#pair-problem', /3 files/);
        await works();
    });

    it('takes the range of a calib.txt that tells of no cameras', async () => {
        writeFileSync(at('calib.txt'), 'width=240\nheight=180\nndisp=24\n');
        await visit.pair(scene('thin'), at('calib.txt'));
        await visit.says('#range-found', /^0 to 23 px, by calib.txt$/);
        assert.equal(await visit.text('#pair-problem'), '');
        assert.match(await visit.tab.$eval('#cameras-note', (note) => note.textContent), /guess.*not to scale/);
        await works();
    });

    it('takes a calib.txt of images of another size and the same aspect, scaled', async () => {
        const calib = join(scene('mixed'), 'calib.txt');
        await visit.pair(scene('thin'), calib);
        // 48 labels for 320 pixels.
        await visit.says('#range-found', /^0 to 35 px, by calib.txt$/);
        assert.equal(await visit.text('#pair-problem'), '');
        assert.match(await visit.text('#notes'), /calib\.txt: is for images of 320 x 240: those of 240 x 180 count as the same, scaled/i);
        await visit.match({ preset: 'fast', device: 'cpu' });
        assert.match(await visit.text('#notes'), /count as the same, scaled/);
        const scaled = native(LEFT, RIGHT, ['--method', 'fast', '--calib', calib], ['points']);
        assert.equal(difference((await visit.save('pfm')).bytes, scaled.pfm), undefined);
        assert.equal(difference((await visit.save('ply')).bytes, scaled.points), undefined);
        await works();
    });

    it('says that a calib.txt is for other images, or makes no sense', async () => {
        writeFileSync(at('calib.txt'), 'width=300\nheight=180\nndisp=24\n');
        await visit.pair(scene('thin'), at('calib.txt'));
        await visit.says('#pair-problem', /300 × 180.*240 × 180/);
        writeFileSync(at('calib.txt'), 'cam0=[1 2 3]\n');
        await visit.pair(scene('thin'), at('calib.txt'));
        await visit.says('#pair-problem', /calib\.txt/);
        await works();
    });

    it('says that a range makes no sense', async () => {
        await visit.set({ range: [20, 10] });
        await visit.says('#range-problem', /whole numbers/);
        await visit.tab.click('#match');
        assert.notEqual(await visit.settled(), 'matching');
        await visit.set({ range: [0, 1_000_000] });
        await visit.says('#range-problem', /range|labels/);
        await works();
    });

    it('keeps no complaint of a range that was changed since', async () => {
        await visit.set({ range: [0, 20] });
        // Before the engine replies.
        await visit.tab.evaluate(() => {
            const max = document.getElementById('max');
            for (const value of ['1000000', '-5', '', '20']) {
                max.value = value;
                max.dispatchEvent(new Event('change'));
            }
        });
        // Earlier requests have been answered by then.
        await visit.match();
        assert.equal(await visit.text('#range-problem'), '');
        assert.match(await visit.text('#facts'), /range 0 to 20/);
    });

    it('goes on with another worker where one has ended', async () => {
        await visit.set({ range: 'automatic', device: 'cpu', preset: 'default' });
        // This message makes the worker end with an uncaught error.
        await visit.tab.evaluate(() => {
            const post = Worker.prototype.postMessage;
            Worker.prototype.postMessage = function (message) {
                Worker.prototype.postMessage = post;
                post.call(this, message.call === 'match' ? null : message);
            };
        });
        await visit.tab.click('#match');
        await visit.says('#problem', /The engine ended .* started again/);
        await works();
        // In the middle of reading a pair: Match reads it again.
        await visit.tab.evaluate(() => {
            const post = Worker.prototype.postMessage;
            Worker.prototype.postMessage = function (message) {
                Worker.prototype.postMessage = post;
                post.call(this, message.call === 'pair' ? null : message);
            };
        });
        assert.equal(await visit.changed(() => visit.choose('left', LEFT, RIGHT)), 'empty');
        await visit.says('#pair-problem', /The engine ended .* started again/);
        await visit.set({ preset: 'fast', range: [0, 31] });
        await visit.tab.click('#match');
        assert.equal(await visit.state('done'), 'done');
        assert.equal(await visit.text('#pair-problem'), '');
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        await works();
    });
});
