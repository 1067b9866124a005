// Films and cameras, matched live: the maps of a frame on every path, and the dialog.
import assert from 'node:assert/strict';
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { native } from './lib/native.mjs';
import { SITE, scene } from './lib/paths.mjs';
import { disparities } from './lib/pfm.mjs';
import { BROWSER, Visit } from './lib/visit.mjs';

const MIXED = ['im0.png', 'im1.png'].map((file) => join(scene('mixed'), file));
/** What a single frame does not tell. */
const METHOD = ['--method', 'fast', ...['level-rows', 'equal-sharpness', 'denoise'].flatMap((key) => ['--set', `${key}=false`])];

/** Defines `window.film(views, seconds)` in a page: a film with the views side by side, each scaled to `width`. */
const filming = () => {
    const decoded = (base64) => createImageBitmap(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))]));
    window.bitmaps = (views) => Promise.all(views.map(decoded));
    window.film = async (views, milliseconds) => {
        const [left, right] = await window.bitmaps(views);
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [2 * left.width, left.height];
        const context = canvas.getContext('2d');
        const recorder = new MediaRecorder(canvas.captureStream(30), { mimeType: 'video/webm', videoBitsPerSecond: 2e7 });
        const parts = [];
        recorder.addEventListener('dataavailable', ({ data }) => parts.push(data));
        const ended = new Promise((resolve) => recorder.addEventListener('stop', resolve));
        recorder.start();
        const begun = performance.now();
        while (performance.now() - begun < milliseconds) {
            context.drawImage(left, 0, 0);
            context.drawImage(right, left.width, 0);
            await new Promise((resolve) => requestAnimationFrame(resolve));
        }
        recorder.stop();
        await ended;
        return new File(parts, 'film.webm', { type: 'video/webm' });
    };
};

describe('a video', () => {
    let visit;
    const views = MIXED.map((path) => readFileSync(path, 'base64'));
    const frames = () => visit.tab.$eval('#live', ({ dataset }) => Number(dataset.frames ?? 0));
    const more = async (than = 0) => {
        await visit.tab.waitForFunction((than) => Number(document.getElementById('live').dataset.frames ?? 0) > than, { timeout: 60_000 }, than);
    };

    before(async () => {
        visit = await Visit.open();
        await visit.tab.evaluate(filming);
    });
    after(() => visit.close());

    /** Matches a pair as a frame in a worker of its own, and returns the disparities and what was learned. */
    const matched = (device, pair) => {
        const script = readdirSync(SITE).find((file) => /^worker-.*\.js$/.test(file));
        return visit.tab.evaluate(async (script, device, pair) => {
            const worker = new Worker(script, { type: 'module' });
            const call = (name, ...args) => new Promise((resolve, reject) => {
                worker.addEventListener('message', ({ data }) => ('value' in data ? resolve(data.value) : 'stage' in data || reject(new Error(data.error ?? data.broken))), { once: true });
                worker.postMessage({ id: 1, call: name, args });
            });
            try {
                await call('start');
                await call('video', device);
                const notes = await call('learn', ...(await window.bitmaps(pair)));
                const { disparity, range, picture } = await call('frame', ...(await window.bitmaps(pair)));
                return { notes, range, width: picture.width, disparity: [...disparity].map((value) => (Number.isFinite(value) ? value : null)) };
            } finally {
                worker.terminate();
            }
        }, script, device, pair);
    };

    it('has the map of the program for a frame, on the CPU path and on a GPU', async (test) => {
        const cpu = await matched('cpu', views);
        const { min, max } = cpu.range;
        const expected = disparities(native(...MIXED, [...METHOD, '--min-disparity', String(min), '--max-disparity', String(max)], ['raw']).pfm);
        const differing = ({ disparity, width }) => disparity.filter((value, i) => (value ?? Infinity) !== expected.at(i % width, Math.floor(i / width))).length;
        assert.equal(cpu.disparity.length, 320 * 240);
        assert.equal(differing(cpu), 0);
        const other = ['im0.png', 'im1.png'].map((file) => readFileSync(join(scene('thin'), file), 'base64'));
        assert.ok(differing(await matched('cpu', other)) > 0);
        if ((await visit.tab.$eval('html', ({ dataset }) => dataset.gpu)) === 'no') {
            test.diagnostic('no GPU here');
            return;
        }
        const gpu = await matched('gpu', views);
        assert.deepEqual(gpu.range, cpu.range);
        assert.equal(differing(gpu), 0);
    });

    it('plays a film with both views, and shows the depth beside it', async () => {
        await visit.tab.evaluate(async (views) => {
            const transfer = new DataTransfer();
            transfer.items.add(await window.film(views, 1500));
            document.body.dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true }));
        }, views);
        await more(2);
        assert.equal(await visit.text('#video-problem'), '');
        assert.match(await visit.text('#video-facts'), /^[\d.]+ frames a second · 320 × 240 pixels · range -?\d+ to \d+ · fast · /);
        assert.equal(await visit.tab.$eval('#video-layout', ({ value }) => value), 'beside left');
    });

    it('records the depth as a film', async () => {
        const film = visit.download(() => visit.tab.click('#video-record'));
        await visit.tab.waitForFunction(() => document.getElementById('video-record').textContent === 'End and save');
        await more((await frames()) + 3);
        await visit.tab.click('#video-record');
        const { name, bytes } = await film;
        assert.match(name, /^film-depth\.(mp4|webm)$/);
        assert.ok((await visit.length(bytes)) > 0);
    });

    it('takes a changed width and layout', async () => {
        const changed = async (id, value) => {
            await visit.tab.$eval('#live', (live) => (live.dataset.frames = '0'));
            await visit.tab.select(id, value);
        };
        await changed('#video-width', '1280');
        await more();
        assert.match(await visit.text('#video-facts'), /320 × 240 pixels/);
        // The right view in the place of the left one matches nothing well, and the page goes on.
        await changed('#video-layout', 'above left');
        await visit.says('#video-problem', /Do both views show the same scene, and is the left one first\?$/);
        await changed('#video-layout', 'beside left');
        await more();
        assert.equal(await visit.text('#video-problem'), '');
    });

    it('rectifies frames taken by hand, by the matches of the first one', async () => {
        const raw = ['left.png', 'right.png'].map((file) => readFileSync(join(scene('raw'), file), 'base64'));
        await visit.tab.evaluate(async (views) => {
            const transfer = new DataTransfer();
            transfer.items.add(await window.film(views, 1500));
            document.body.dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true }));
        }, raw);
        await visit.says('#video-note', /^rectified by the matches of the first frame, without a scale: /);
        await visit.says('#video-facts', /frames a second/);
        assert.equal(await visit.text('#video-problem'), '');
    });

    it('ends with its dialog, and leaves the pair as it was', async () => {
        await visit.tab.click('#video-close');
        await visit.match({ device: 'cpu', preset: 'fast' });
        const { bytes } = await visit.save('pfm');
        assert.equal(bytes.equals(native(...MIXED, ['--method', 'fast', '--calib', join(scene('mixed'), 'calib.txt')]).pfm), true);
    });

    it('says what cannot be played', async () => {
        await visit.give('dropped', [{ name: 'film.mp4', path: MIXED[0] }]);
        await visit.says('#video-problem', /^film\.mp4 cannot be played: .*Give a film that this browser plays/);
        await visit.tab.click('#video-close');
    });

    it('matches two cameras, and one that gives both views', async () => {
        await visit.tab.evaluate(async (views) => {
            const [left, right] = await window.bitmaps(views);
            const cameras = { one: [left], two: [right], wide: [left, right] };
            const devices = navigator.mediaDevices;
            devices.enumerateDevices = async () => Object.keys(cameras).map((deviceId) => ({ kind: 'videoinput', deviceId, label: `camera ${deviceId}` }));
            devices.getUserMedia = async ({ video }) => {
                if (window.refuses) {
                    throw new DOMException('Permission denied', 'NotAllowedError');
                }
                const images = cameras[video.deviceId?.exact ?? 'one'];
                const canvas = document.createElement('canvas');
                [canvas.width, canvas.height] = [images.length * left.width, left.height];
                const context = canvas.getContext('2d');
                setInterval(() => images.forEach((image, i) => context.drawImage(image, i * left.width, 0)), 30);
                return canvas.captureStream(30);
            };
        }, views);
        await visit.tab.click('#open-video');
        await visit.tab.$eval('#live', (live) => (live.dataset.frames = '0'));
        await visit.tab.click('#video-cameras');
        await more();
        assert.equal(await visit.text('#video-problem'), '');
        assert.deepEqual(await visit.tab.$$eval('#left-camera option', (all) => all.map(({ textContent }) => textContent)), ['camera one', 'camera two', 'camera wide']);
        await visit.tab.select('#right-camera', 'both');
        await visit.tab.select('#left-camera', 'wide');
        await visit.says('#video-facts', /320 × 240 pixels/);
        assert.equal(await visit.text('#video-problem'), '');
        await visit.tab.evaluate(() => (window.refuses = true));
        await visit.tab.click('#video-cameras');
        await visit.says('#video-problem', /^The cameras cannot be used: Permission denied\./);
        await visit.tab.click('#video-close');
    });
});
