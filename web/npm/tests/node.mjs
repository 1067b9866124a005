// Tests the package in Node.js, in the fresh project that contains it. Needs MRFGS, the program, and MRFGS_ROOT, the repository.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { createMatcher } from '@mrfgs/wasm';

const root = process.env.MRFGS_ROOT;
const { PNG } = createRequire(join(root, 'web/package.json'))('pngjs');
const folder = mkdtempSync(join(tmpdir(), 'mrfgs-npm-'));
after(() => rmSync(folder, { recursive: true }));
const files = ['im0.png', 'im1.png'].map((name) => join(root, 'testdata/mixed', name));
const [left, right] = files.map((file) => PNG.sync.read(readFileSync(file)));
const range = { minDisparity: 0, maxDisparity: 47 };

/** The disparity and validity maps of the program, top row first. */
function program(left, right, ...flags) {
    const map = join(folder, 'map.pfm');
    const also = ['--also', 'validity', '--device', 'cpu', '--quiet'];
    execFileSync(process.env.MRFGS, ['match', left, right, map, '--max-disparity', '47', ...also, ...flags]);
    const bytes = readFileSync(map);
    const [, width, height] = /^Pf\n(\d+) (\d+)\n-1[^\n]*\n/.exec(bytes.toString('latin1')).map(Number);
    const row = 4 * width;
    const start = bytes.length - row * height;
    const rows = Array.from({ length: height }, (_, y) => bytes.subarray(start + row * (height - 1 - y), start + row * (height - y)));
    return { disparity: Buffer.concat(rows), validity: PNG.sync.read(readFileSync(join(folder, 'map.validity.png'))).data };
}

function same(found, expected) {
    assert.equal(Buffer.compare(Buffer.from(found.disparity.buffer), expected.disparity), 0, 'the disparities differ');
    assert.deepEqual(found.reasons, Uint8Array.from(found.reasons, (_, i) => expected.validity[4 * i]), 'the reasons differ');
}

for (const method of ['default', 'fast']) {
    test(`${method} gives the map of the program`, async () => {
        const matcher = await createMatcher({ method, device: 'auto' });
        const heard = [];
        const found = await matcher.match(left, right, { ...range, onProgress: (done) => heard.push(done) });
        assert.deepEqual([found.width, found.height, found.confidence.length], [320, 240, 320 * 240]);
        assert.ok(heard.length > 2 && heard.every((done) => done >= 0 && done <= 1), 'no progress is reported');
        assert.equal(matcher.reasons.length, 9);
        same(found, program(...files, '--method', method));
        // Control: other views must give other maps.
        const other = await matcher.match(right, left, range);
        assert.throws(() => same(other, program(...files, '--method', method)));
    });
}

test('16-bit grey views give the map of the program', async () => {
    const grey = [left, right].map(({ data, width, height }) => {
        const samples = Uint16Array.from({ length: width * height }, (_, i) => 200 * data[4 * i] + data[4 * i + 1]);
        return { data: samples, width, height };
    });
    const names = grey.map(({ data, width, height }, view) => {
        const png = new PNG({ width, height, bitDepth: 16, colorType: 0, inputColorType: 0, inputHasAlpha: false });
        png.data = Buffer.from(data.buffer);
        writeFileSync(join(folder, `${view}.png`), PNG.sync.write(png, { bitDepth: 16, colorType: 0, inputColorType: 0, inputHasAlpha: false }));
        return join(folder, `${view}.png`);
    });
    const matcher = await createMatcher({ method: 'fast' });
    same(await matcher.match(...grey, range), program(...names, '--method', 'fast'));
});

test('a prior gives the map of the program', async () => {
    const poster = (name) => join(root, 'testdata/poster', name);
    const files = ['im0.png', 'im1.png'].map(poster);
    const views = files.map((file) => PNG.sync.read(readFileSync(file)));
    const matcher = await createMatcher({ method: 'fast' });
    const match = (prior) => matcher.match(...views, { ...range, prior });
    const expected = program(...files, '--method', 'fast', '--prior', poster('lidar.csv'));
    writeFileSync(join(folder, 'known.pfm'), readFileSync(join(folder, 'map.pfm')));
    const points = readFileSync(poster('lidar.csv'), 'utf8').trim().split('\n').map((line) => line.split(',').map(Number)).filter((row) => row.every(Number.isFinite));
    const found = await match({ points });
    same(found, expected);
    assert.deepEqual([found.prior.kind, found.prior.given], ['points', points.length]);
    assert.ok(found.prior.dropped > 0 && found.prior.trust > 0.9 && found.warnings.every((text) => !text.includes('prior')), JSON.stringify(found.prior));
    same(await match({ points: points.flat() }), expected);
    same(await match({ points: new Float64Array(points.flat()), sigma: 0.25 }), expected);
    same(await match({ points: points.map((row) => [...row, 0.25]), sigma: 3 }), expected);
    // Control: without it, and with another sigma, the map is another one.
    const without = await matcher.match(...views, range);
    assert.equal(without.prior, undefined);
    assert.throws(() => same(without, expected));
    const unsure = await match({ points, sigma: 3 });
    assert.throws(() => same(unsure, expected));
    // That map as a surface.
    const surface = { disparity: found.disparity, kind: 'surface' };
    const flags = ['--prior', join(folder, 'known.pfm'), '--prior-kind', 'surface', '--prior-sigma', '2'];
    const bySurface = program(...files, '--method', 'fast', ...flags);
    same(await match({ ...surface, sigma: 2 }), bySurface);
    same(await match({ ...surface, sigma: new Float32Array(found.disparity.length).fill(2) }), bySurface);
    assert.throws(() => same(found, bySurface));
    // One that knows nothing changes nothing, and one that the images contradict is not used.
    const nothing = await match({ disparity: new Float32Array(found.disparity.length).fill(NaN) });
    assert.deepEqual([nothing.disparity, nothing.prior.given], [without.disparity, 0]);
    const wrong = await match({ disparity: found.disparity.map((d) => 47 - d) });
    assert.deepEqual([wrong.disparity, wrong.prior.trust], [without.disparity, 0]);
    assert.match(wrong.warnings.join('\n'), /^the images contradict the prior, so it was not used: /m);
});

test('the range is found if not given, and concurrent matches run in turn', async () => {
    const matcher = await createMatcher({ method: 'fast', device: 'cpu' });
    const [first, second] = await Promise.all([matcher.match(left, right), matcher.match(left, right, range)]);
    assert.ok(first.maxDisparity > first.minDisparity);
    assert.deepEqual([second.minDisparity, second.maxDisparity], [0, 47]);
});

test('an abort ends a match, and the next one succeeds', async () => {
    const matcher = await createMatcher({ method: 'fast' });
    const stopped = new AbortController();
    const match = matcher.match(left, right, { ...range, signal: stopped.signal, onProgress: () => stopped.abort() });
    await assert.rejects(match, { name: 'AbortError' });
    await assert.rejects(matcher.match(left, right, { ...range, signal: AbortSignal.abort() }), { name: 'AbortError' });
    assert.equal((await matcher.match(left, right, range)).width, 320);
});

test('bad input is reported in one line', async () => {
    const matcher = await createMatcher();
    const cases = [
        [[left, { ...right, width: 160, height: 480 }, range], /^.*320 x 240.*160 x 480.*$/],
        [[left, { data: right.data, width: 7, height: 7 }, range], /^right: .* samples do not fit 7 x 7 pixels with 1 to 4 samples each$/],
        [[undefined, right, range], /^left: give ImageData.*$/],
        [[left, { data: new Uint16Array(4 * 320 * 240), width: 320, height: 240 }, range], /^one image has 8 bits.*$/],
        [[left, right, { minDisparity: 5, maxDisparity: 4 }], /^.*maxDisparity.*$/],
        [[left, right, { minDisparity: 0, maxDisparity: 100_000 }], /^.*maxDisparity.*$/],
        [[left, right, { maxDisparity: 4.5 }], /^maxDisparity is 4.5.*$/],
        [[left, right, { minDisparity: 1 }], /^minDisparity is given without maxDisparity.*$/],
    ];
    const priors = [
        [{}, /^prior: give either points or disparity$/],
        [{ points: [], disparity: new Float32Array(1) }, /^prior: give either points or disparity$/],
        [{ points: [[1, 2]] }, /^prior.points: give rows of x, y, disparity, .*$/],
        [{ points: [1, 2, 3, 4] }, /^prior.points: give rows of x, y, disparity, .*$/],
        [{ points: 'lidar.csv' }, /^prior.points: give rows of x, y, disparity, .*$/],
        [{ points: [[1, 2, 3], [1, 2, NaN]] }, /^point 2 of the prior has a value that is not a number$/],
        [{ points: [[1, 2, 3, -1]] }, /^point 1 of the prior .* -1 px.*$/],
        [{ points: [[1, 2, 3, 0]] }, /^prior.points: point 1 has a sigma of 0.*$/],
        [{ points: [[400, 2, 3]] }, /^none of the 1 points .* 320 x 240 pixels$/],
        [{ points: [[1, 2, 3]], sigma: -1 }, /^prior.sigma is -1: give pixels above 0$/],
        [{ points: [[1, 2, 3]], kind: 'surface' }, /^prior: points .* no surface$/],
        [{ disparity: new Float32Array(7) }, /^prior.disparity: give a Float32Array of 320 x 240 values.*$/],
        [{ disparity: [1, 2, 3] }, /^prior.disparity: give a Float32Array.*$/],
        [{ disparity: new Float32Array(320 * 240), sigma: new Float32Array(7) }, /^prior.sigma: give a Float32Array of 320 x 240.*$/],
        [{ disparity: new Float32Array(320 * 240), sigma: new Float32Array(320 * 240) }, /^the prior at column 0, row 0 .* not above 0$/],
        [{ disparity: new Float32Array(320 * 240), kind: 'dots' }, /^prior.kind is "dots": use points, surface$/],
    ];
    cases.push(...priors.map(([prior, message]) => [[left, right, { ...range, prior }], message]));
    for (const [args, message] of cases) {
        await assert.rejects(matcher.match(...args), { message });
    }
    matcher.close();
    await assert.rejects(matcher.match(left, right, range), { message: /closed/ });
    await assert.rejects(createMatcher({ method: 'quick' }), { message: /^method is "quick": use default, / });
    await assert.rejects(createMatcher({ device: 'gpu' }), { message: /^device is "gpu": use auto, cpu, webgpu$/ });
    await assert.rejects(createMatcher({ device: 'webgpu' }), { message: /Node.js/ });
});
