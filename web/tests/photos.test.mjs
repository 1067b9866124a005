// Photos as users have them: in browser formats, rotated, in one image, in a folder.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { ROOT, scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { Visit } from './lib/visit.mjs';

const { PNG } = createRequire(join(ROOT, 'web/package.json'))('pngjs');
const VIEWS = ['im0.png', 'im1.png'].map((file) => join(scene('mixed'), file));
const RANGE = [0, 47];

/** Inserts a segment into a JPEG. */
function told(jpeg, marker, body) {
    const head = Buffer.from([0xff, marker, 0, 0]);
    head.writeUInt16BE(body.length + 2, 2);
    return Buffer.concat([jpeg.subarray(0, 2), head, body, jpeg.subarray(2)]);
}

/** Adds the EXIF tag Orientation to a JPEG. */
function turned(jpeg, orientation) {
    const tiff = Buffer.from('4d4d002a00000008000101120003000000010000000000000000', 'hex');
    tiff.writeUInt16BE(orientation, 18);
    return told(jpeg, 0xe1, Buffer.concat([Buffer.from('Exif\0\0', 'latin1'), tiff]));
}

/** Both views in one image, the first one on the left or on top. */
function joined(beside, views = VIEWS) {
    const [left, right] = views.map((path) => PNG.sync.read(readFileSync(path)));
    const { width, height } = left;
    const both = new PNG(beside ? { width: 2 * width, height } : { width, height: 2 * height });
    PNG.bitblt(left, both, 0, 0, width, height, 0, 0);
    PNG.bitblt(right, both, 0, 0, width, height, beside ? width : 0, beside ? 0 : height);
    return PNG.sync.write(both);
}

/** An MPO file of two JPEG images, with its list of images in the byte order of Intel. */
function mpo(left, right) {
    const list = Buffer.alloc(4 + 8 + 2 + 12 + 4 + 2 * 16);
    list.write('MPF\0II*\0', 'latin1');
    list.writeUInt32LE(8, 8);
    list.writeUInt16LE(1, 12);
    list.writeUInt16LE(0xb002, 14);
    list.writeUInt16LE(7, 16);
    list.writeUInt32LE(2 * 16, 18);
    list.writeUInt32LE(26, 22);
    const first = told(left, 0xe2, list);
    // After the start of the file, the marker and the length of the segment, and its signature.
    const origin = 2 + 4 + 4;
    const at = 6 + list.indexOf('MPF\0') + 4 + 26;
    first.writeUInt32LE(0x20002, at);
    first.writeUInt32LE(first.length, at + 4);
    first.writeUInt32LE(0x20002, at + 16);
    first.writeUInt32LE(right.length, at + 20);
    first.writeUInt32LE(first.length - origin, at + 24);
    return Buffer.concat([first, right]);
}

describe('photos', () => {
    let visit;
    let folder;
    const at = (name) => join(folder, name);
    const flags = ['--method', 'fast', '--max-disparity', '47'];
    const expected = native(...VIEWS, flags);
    const matches = async () => {
        await visit.match({ preset: 'fast', device: 'cpu', range: RANGE });
        return (await visit.save('pfm')).bytes;
    };
    /** Converts a view to another format with the browser; undefined if it does not write that format. */
    const recoded = async (path, type, turn = false) => {
        const found = await visit.tab.evaluate(async (content, type, turn) => {
            const bytes = Uint8Array.from(atob(content), (c) => c.charCodeAt(0));
            const image = await createImageBitmap(new Blob([bytes]));
            const [w, h] = turn ? [image.height, image.width] : [image.width, image.height];
            const canvas = new OffscreenCanvas(w, h);
            const context = canvas.getContext('2d');
            if (turn) {
                context.setTransform(0, -1, 1, 0, 0, image.width);
            }
            context.drawImage(image, 0, 0);
            const blob = await canvas.convertToBlob({ type, quality: 1 });
            const data = new Uint8Array(await blob.arrayBuffer());
            return blob.type === type ? btoa(Array.from(data, (byte) => String.fromCharCode(byte)).join('')) : undefined;
        }, readFileSync(path, 'base64'), type, turn);
        return found && Buffer.from(found, 'base64');
    };
    before(async () => {
        visit = await Visit.open();
        folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
    });
    after(async () => {
        rmSync(folder, { recursive: true, force: true });
        await visit.close();
    });

    it('takes what the browser decodes: WebP', async (test) => {
        for (const [i, path] of VIEWS.entries()) {
            const webp = await recoded(path, 'image/webp');
            if (!webp) {
                test.skip('this browser writes no WebP');
                return;
            }
            writeFileSync(at(`im${i}.webp`), webp);
        }
        assert.equal(await visit.changed(() => visit.choose('left', at('im0.webp'), at('im1.webp'))), 'done');
        await matches();
        assert.match(await visit.text('#facts'), /^320 × 240/);
    });

    it('takes what the browser decodes: AVIF and GIF', async () => {
        // A crop of each view, compressed by Pillow.
        const [left, top, width, height] = [60, 40, 160, 120];
        for (const [i, path] of VIEWS.entries()) {
            const part = new PNG({ width, height });
            PNG.bitblt(PNG.sync.read(readFileSync(path)), part, left, top, width, height, 0, 0);
            writeFileSync(at(`part${i}.png`), PNG.sync.write(part));
        }
        const wanted = disparities(native(at('part0.png'), at('part1.png'), flags).pfm);
        for (const type of ['avif', 'gif']) {
            const files = ['im0', 'im1'].map((name) => join(ROOT, 'web/tests/files', `${name}.${type}`));
            assert.equal(await visit.changed(() => visit.choose('left', ...files)), 'done', type);
            const found = disparities(await matches());
            assert.deepEqual([found.width, found.height], [width, height]);
            const places = Array.from({ length: width * height }, (_, i) => [i % width, Math.floor(i / width)]);
            const near = places.filter((place) => Math.abs(found.at(...place) - wanted.at(...place)) < 1).length;
            assert.ok(near > 0.9 * places.length, `${type}: ${near} of the pixels are within 1 px of the map of the PNG`);
        }
    });

    it('turns photos upright', async () => {
        for (const [i, path] of VIEWS.entries()) {
            // Stored rotated by a quarter turn, with the matching tag.
            writeFileSync(at(`turned${i}.jpg`), turned(await recoded(path, 'image/jpeg', true), 6));
        }
        const files = ['turned0.jpg', 'turned1.jpg'].map(at);
        assert.equal(await visit.changed(() => visit.choose('left', ...files)), 'done');
        const map = await matches();
        assert.match(await visit.text('#facts'), /^320 × 240/);
        assert.doesNotMatch(await visit.text('#warnings'), /turned|column/);
        assert.equal(difference(map, native(...files, [...flags, '--orient']).pfm), undefined);
    });

    it('cuts an image that holds both views, side by side', async () => {
        writeFileSync(at('both.png'), joined(true));
        assert.equal(await visit.changed(() => visit.choose('left', at('both.png'))), 'done');
        await visit.says('#pair-note', /left and right half/);
        assert.equal(difference(await matches(), expected.pfm), undefined);
        assert.equal((await visit.save('pfm')).name, 'both-disparity.pfm');
    });

    it('takes both views of a 3-D camera: MPO', async () => {
        const [left, right] = await Promise.all(VIEWS.map((path) => recoded(path, 'image/jpeg')));
        writeFileSync(at('camera.mpo'), mpo(left, right));
        [left, right].forEach((view, i) => writeFileSync(at(`mpo${i}.jpg`), view));
        assert.equal(await visit.changed(() => visit.choose('left', at('camera.mpo'))), 'done');
        await visit.says('#pair-note', /holds both views/);
        assert.deepEqual(await visit.names(), ['camera left.jpg', 'camera right.jpg']);
        const map = await matches();
        assert.equal(difference(map, native(at('mpo0.jpg'), at('mpo1.jpg'), flags).pfm), undefined);
        assert.equal(difference(map, native(at('camera.mpo'), undefined, flags).pfm), undefined, 'as the program reads the file');
        // Without the second image, the file counts as one view, which begins a new pair beside a scene.
        await visit.scene('thin');
        writeFileSync(at('cut.mpo'), mpo(left, right).subarray(0, left.length + 100));
        assert.equal(await visit.changed(() => visit.choose('left', at('cut.mpo'))), 'empty');
    });

    it('takes both views of a 3-D camera: JPS, with the right view on the left unless it says otherwise', async () => {
        const whole = (beside, views) => {
            writeFileSync(at('whole.png'), joined(beside, views));
            return recoded(at('whole.png'), 'image/jpeg');
        };
        const said = (layout, flags) => Buffer.concat([Buffer.from('_JPSJPS_', 'latin1'), Buffer.from([0, 4, 0, flags, layout, 1])]);
        const beside = await whole(true);
        const files = [
            ['plain.jps', await whole(true, [...VIEWS].reverse()), /right view on the left/],
            ['left first.jps', told(beside, 0xe3, said(2, 4)), /left and right half/],
            ['above.jps', told(await whole(false), 0xe3, said(3, 4)), /upper half/],
        ];
        for (const [name, bytes, note] of files) {
            writeFileSync(at(name), bytes);
            assert.equal(await visit.changed(() => visit.choose('left', at(name))), 'done', name);
            await visit.says('#pair-note', note);
            const there = disparities(native(at(name), undefined, flags).pfm);
            const here = disparities(await matches());
            assert.deepEqual([here.width, here.height], [there.width, there.height]);
            const places = Array.from({ length: here.width * here.height }, (_, i) => [i % here.width, Math.floor(i / here.width)]);
            const near = places.filter((place) => Math.abs(here.at(...place) - there.at(...place)) < 1).length;
            assert.ok(near > 0.98 * places.length, `${name}: ${near} of ${places.length} pixels as by the program`);
        }
    });

    it('cuts one with a view above the other, by guess and by button', async () => {
        writeFileSync(at('stack.png'), joined(false));
        assert.equal(await visit.changed(() => visit.choose('left', at('stack.png'))), 'done');
        await visit.says('#pair-note', /upper half/);
        assert.equal(difference(await matches(), expected.pfm), undefined);
        // Wide views on top of each other are not portrait; similar halves are split in any shape.
        const wide = new PNG({ width: 240, height: 2 * 67 });
        ['im0.png', 'im1.png'].forEach((file, i) => {
            PNG.bitblt(PNG.sync.read(readFileSync(join(scene('border'), file))), wide, 0, 0, 240, 67, 0, 67 * i);
        });
        writeFileSync(at('wide.png'), PNG.sync.write(wide));
        assert.equal(await visit.changed(() => visit.choose('left', at('wide.png'))), 'done');
        await visit.says('#pair-note', /upper half/);
        // A single view is left as it is, and a button splits it.
        await visit.scene('thin');
        assert.equal(await visit.changed(() => visit.choose('left', VIEWS[0])), 'empty');
        assert.equal(await visit.changed(() => visit.tab.click('#cut-above')), 'ready');
        assert.match(await visit.text('#left .name'), /left/);
    });

    it('matches at half the size what takes too much memory, and offers the full one', async () => {
        for (const [i, path] of VIEWS.entries()) {
            const from = PNG.sync.read(readFileSync(path));
            const to = new PNG({ width: 2 * from.width, height: 2 * from.height });
            for (let at = 0; at < to.width * to.height; at += 1) {
                const [x, y] = [at % to.width, Math.floor(at / to.width)].map((place) => place >> 1);
                from.data.copy(to.data, 4 * at, 4 * (y * from.width + x), 4 * (y * from.width + x) + 4);
            }
            writeFileSync(at(`large${i}.png`), PNG.sync.write(to));
        }
        const files = ['large0.png', 'large1.png'].map(at);
        assert.equal(await visit.changed(() => visit.choose('left', ...files)), 'done');
        await visit.match({ preset: 'fgs', device: 'cpu', range: [0, 600] });
        assert.match(await visit.text('#facts'), /^640 × 480 pixels · at half size/);
        const half = native(...files, ['--method', 'fgs', '--max-disparity', '600', '--set', 'match-size=half']);
        assert.equal(difference((await visit.save('pfm')).bytes, half.pfm), undefined);
        await visit.says('#notes', /takes more memory than a match may have here/);
        await visit.tab.evaluate(() => document.querySelector('#notes button').click());
        await visit.state('matching');
        await visit.tab.click('#cancel');
        await visit.state('done');
        const size = () => visit.tab.$eval('#size', (select) => select.value);
        assert.equal(await size(), 'full');
        // The setting applied to that pair only.
        assert.equal(await visit.changed(() => visit.choose('left', ...VIEWS)), 'done');
        assert.equal(await size(), 'automatic');
    });

    it('takes a folder of a benchmark, and calls the files after it', async () => {
        const names = ['im0.png', 'im1.png', 'calib.txt', 'disp0GT.pfm', 'mask0nocc.png'];
        const files = names.map((name) => ({ name, path: join(scene('thin'), name) }));
        const drop = () => visit.give('dropped', [{ folder: 'Motorcycle', files }]);
        await visit.set({ range: 'automatic' });
        assert.equal(await visit.changed(drop), 'done');
        assert.equal(await visit.text('#pair-note'), 'Of 5 files im0.png and im1.png are the views.');
        await visit.says('#range-found', /^0 to 31 px, by calib\.txt$/);
        await visit.match({ preset: 'fast', device: 'cpu', range: 'automatic' });
        assert.equal((await visit.save('pfm')).name, 'Motorcycle-disparity.pfm');
    });
});
