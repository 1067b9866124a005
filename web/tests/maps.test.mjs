// The maps of the page are identical to those of the program, on GPU and CPU.
import assert from 'node:assert/strict';
import { cpSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { difference, native } from './lib/native.mjs';
import { scene } from './lib/paths.mjs';
import { Visit } from './lib/visit.mjs';

describe('maps', () => {
    let visit;
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    for (const name of ['mixed', 'steep']) {
        const [left, right] = ['im0.png', 'im1.png'].map((file) => join(scene(name), file));
        for (const preset of ['default', 'fast']) {
            // Range and cameras come from the calib.txt beside the left view.
            const expected = native(left, right, ['--method', preset], ['raw', 'confidence', 'validity', 'points']);
            for (const device of ['gpu', 'cpu']) {
                it(`${name}, ${preset}, ${device}`, async () => {
                    await visit.pair(scene(name), join(scene(name), 'calib.txt'));
                    await visit.match({ preset, device });
                    const facts = await visit.text('#facts');
                    assert.match(facts, device === 'gpu' ? /WebGPU/ : /CPU path/);
                    assert.doesNotMatch(await visit.text('#warnings'), /CPU/);
                    const map = await visit.save('pfm');
                    assert.equal(map.name, 'im0-disparity.pfm');
                    assert.equal(difference(map.bytes, expected.pfm), undefined);
                    for (const output of ['confidence', 'validity']) {
                        assert.equal(difference((await visit.save(output)).bytes, expected[output]), undefined, output);
                    }
                    assert.equal(difference((await visit.save('ply')).bytes, expected.points), undefined);
                    // Control: a flipped bit is detected anywhere in the file.
                    for (const at of [20, map.bytes.length >> 1, map.bytes.length - 1]) {
                        const flipped = Buffer.from(map.bytes);
                        flipped[at] ^= 1;
                        assert.equal(difference(flipped, expected.pfm), at);
                    }
                });
            }
        }
    }

    it('compares CPU and GPU', async () => {
        await visit.tab.click('#compare');
        await visit.state('done');
        assert.match(await visit.text('#comparison'), /^0 of 43,200 pixels differ \(.*WebGPU/);
    });

    it('finds the range that the program finds', async () => {
        const folder = mkdtempSync(join(tmpdir(), 'mrfgs-'));
        try {
            const views = ['im0.png', 'im1.png'].map((file) => {
                cpSync(join(scene('slanted'), file), join(folder, file));
                return join(folder, file);
            });
            const { range, pfm } = native(...views);
            await visit.pair(folder);
            await visit.says('#range-found', new RegExp(`^${range.min} to ${range.max} px, by sparse matches$`));
            await visit.match({ preset: 'default', device: 'cpu', range: 'automatic' });
            assert.equal(difference((await visit.save('pfm')).bytes, pfm), undefined);
        } finally {
            rmSync(folder, { recursive: true, force: true });
        }
    });

    it('takes a range, also below 0', async () => {
        const views = ['im0.png', 'im1.png'].map((file) => join(scene('slanted'), file));
        const { pfm } = native(...views, ['--min-disparity', '-8', '--max-disparity', '40']);
        await visit.match({ range: [-8, 40] });
        assert.match(await visit.text('#facts'), /range -8 to 40/);
        assert.equal(difference((await visit.save('pfm')).bytes, pfm), undefined);
        await visit.match({ range: [0, 31] });
        const png = await visit.save('png');
        assert.equal(png.name, 'im0-disparity.png');
        assert.equal(png.bytes.readUInt8(24), 16, 'bits');
    });
});
