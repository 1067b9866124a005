// Download size of the first map, stopping a match, browsers without WebGPU, and offline use.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, describe, it } from 'node:test';
import { gzipSync } from 'node:zlib';
import { difference, native } from './lib/native.mjs';
import { SITE, scene } from './lib/paths.mjs';
import { BROWSER, Visit } from './lib/visit.mjs';

const views = (name) => ['im0.png', 'im1.png'].map((file) => join(scene(name), file));
const CALIBRATION = join(scene('mixed'), 'calib.txt');

describe('the first map', () => {
    it('takes 1.5 MB at most, by gzip', async () => {
        const asked = [];
        const visit = await Visit.open({
            before: async ({ tab, host }) => {
                const push = host.asked.push.bind(host.asked);
                host.asked.push = (path) => asked.push([path, Date.now()]) && push(path);
                await tab.evaluateOnNewDocument(() => {
                    new MutationObserver(() => {
                        if (document.querySelector('#outcome:not([hidden])')) {
                            window.firstMap ??= Date.now();
                        }
                    }).observe(document, { subtree: true, childList: true, attributes: true });
                });
            },
        });
        const firstMap = await visit.tab.evaluate(() => window.firstMap);
        await visit.close();
        const loaded = new Set(asked.filter(([, when]) => when < firstMap).map(([path]) => path.replace('/some/folder/', '') || 'index.html'));
        const files = [...loaded].filter((file) => file !== '/favicon.ico');
        assert.ok(files.some((file) => file.endsWith('.wasm')) && files.includes('scenes/mixed/im1.png'), files.join(', '));
        assert.ok(asked.length > files.length, 'the rest comes later');
        const packed = files.map((file) => gzipSync(readFileSync(join(SITE, file)), { level: 9 }).length);
        const sum = packed.reduce((sum, bytes) => sum + bytes, 0);
        assert.ok(sum < 1_500_000, `${sum} bytes in ${files.join(', ')}`);
    });
});

describe('a match', () => {
    let visit;
    const expected = native(...views('mixed'));
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    for (const device of ['gpu', 'cpu']) {
        it(`stops when it is told to, on the ${device}`, async () => {
            await visit.pair(scene('mixed'), CALIBRATION);
            // A match that takes a while on either device.
            await visit.set({ device, preset: device === 'cpu' ? 'paper' : 'default', range: 'automatic' });
            await visit.begin();
            await visit.tab.click('#cancel');
            await visit.state('done');
            await visit.says('#problem', /^Stopped\.$/);
            await visit.match({ preset: 'default' });
            assert.equal(await visit.text('#problem'), '');
            assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
        });
    }

    it('stops even where the worker does not hear', async () => {
        await visit.tab.evaluate(() => {
            const post = Worker.prototype.postMessage;
            Worker.prototype.postMessage = function (message) {
                if (!message.cancel) {
                    post.call(this, message);
                }
            };
        });
        // On a software driver this takes a little longer than the page waits: the driver finishes its queue, and draws no page meanwhile.
        // Firefox has a faster one.
        await visit.set({ device: 'gpu', preset: 'paper', range: [0, BROWSER === 'firefox' ? 63 : 15] });
        await visit.begin();
        await visit.tab.click('#cancel');
        // The last map is kept.
        await visit.state('done');
        await visit.says('#problem', /^Stopped\.$/);
        await visit.match({ device: 'cpu', preset: 'default', range: 'automatic' });
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
    });

    it('gives way to another pair', async () => {
        await visit.set({ device: 'gpu' });
        await visit.tab.click('#match');
        await visit.state('matching');
        await visit.pair(scene('thin'), join(scene('thin'), 'calib.txt'));
        await visit.match({ device: 'cpu' });
        assert.equal(difference((await visit.save('pfm')).bytes, native(...views('thin')).pfm), undefined);
    });
});

describe('a device that is lost', { skip: BROWSER !== 'chromium' && 'only Chromium can be told to end its GPU process' }, () => {
    let visit;
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    it('gives way to the CPU path, and is opened anew', async () => {
        const expected = native(...views('mixed'));
        await visit.pair(scene('mixed'), CALIBRATION);
        await visit.set({ device: 'gpu', preset: 'default', range: 'automatic' });
        await visit.begin();
        const session = await visit.browser.target().createCDPSession();
        await session.send('Browser.crashGpuProcess');
        assert.equal(await visit.state('done', 'ready'), 'done', await visit.text('#problem'));
        await visit.says('#warnings', /failed|lost/);
        assert.match(await visit.text('#facts'), /CPU path/);
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);

        await visit.match();
        assert.match(await visit.text('#facts'), /WebGPU/);
        assert.equal(difference((await visit.save('pfm')).bytes, expected.pfm), undefined);
    });
});

describe('without WebGPU', () => {
    let visit;
    before(async () => (visit = await Visit.open({ gpu: false })));
    after(() => visit.close());

    it('the CPU path matches, and the page says why', async () => {
        await visit.says('#device-note', /WebGPU.*CPU path is used.*preset for speed, fast/);
        assert.equal(await visit.tab.$eval('#preset', (select) => select.value), 'fast');
        assert.equal(await visit.tab.$eval('input[value=gpu]', (input) => input.disabled), true);
        assert.equal(await visit.tab.$eval('input[value=cpu]', (input) => input.checked), true);
        await visit.pair(scene('slanted'), join(scene('slanted'), 'calib.txt'));
        await visit.match();
        assert.match(await visit.text('#facts'), /CPU path/);
        assert.equal(await visit.tab.$eval('#compare', (button) => button.disabled), true);
        const expected = native(...views('slanted'), ['--method', 'fast']).pfm;
        assert.equal(difference((await visit.save('pfm')).bytes, expected), undefined);
    });
});

describe('without a network', () => {
    let visit;
    const caches = (tab) => tab.evaluate(async () => (await window.caches.keys()).sort());
    before(async () => {
        visit = await Visit.open({
            // Caches of an earlier build, and of a page in another folder of the host.
            before: async ({ tab, url }) => {
                await tab.goto(`${url}icon.svg`);
                const names = [`mrfgs ${url} 0123456789abcdef`, `mrfgs ${url}other/ 0123456789abcdef`];
                await tab.evaluate((names) => Promise.all(names.map((name) => window.caches.open(name))), names);
            },
        });
    });
    after(() => visit.close());

    it('the page opens again, with what was opened before', async () => {
        await visit.tab.waitForSelector('html[data-offline=ready]');
        await visit.tab.waitForFunction(() => navigator.serviceWorker.controller?.state === 'activated');
        const kept = await caches(visit.tab);
        assert.equal(kept.length, 2, kept);
        assert.ok(kept.includes(`mrfgs ${visit.url}other/ 0123456789abcdef`), kept);
        assert.ok(!kept.includes(`mrfgs ${visit.url} 0123456789abcdef`), kept);
        await visit.set({ device: 'cpu' });
        assert.equal(await visit.scene('thin'), 'done');

        await visit.host.stop();
        await visit.tab.reload();
        await visit.tab.waitForSelector('html[data-gpu]');
        // The first view is available, too.
        assert.equal(await visit.settled(), 'done');
        await visit.set({ device: 'cpu' });
        assert.equal(await visit.scene('thin'), 'done');
        assert.equal(difference((await visit.save('pfm')).bytes, native(...views('thin')).pfm), undefined);
        await visit.tab.click('#tab-surface');
        // The chunk is available, and reports a missing WebGL itself.
        await visit.says('#surface-note', /[\d,]+ points|no WebGL 2/);
        await visit.tab.click('[data-scene=steep]');
        await visit.says('#pair-problem', /could not be loaded/);
        // The browser reports the scene that it could not fetch.
        visit.faults = visit.faults.filter((fault) => !/steep|ERR_|Failed to (load|fetch)|NetworkError/.test(fault));
    });
});

describe('a new version', () => {
    let visit;
    before(async () => (visit = await Visit.open()));
    after(() => visit.close());

    it('is told, and taken with one click', async () => {
        await visit.tab.waitForFunction(() => navigator.serviceWorker.controller?.state === 'activated');
        assert.equal(await visit.tab.$eval('#update', (note) => note.checkVisibility()), false);
        visit.host.replace('service-worker.js', (text) => `${text}\nself.version = 2;`);
        await visit.tab.reload();
        await visit.says('#update', /new version/);
        const loaded = visit.tab.waitForNavigation();
        await visit.tab.click('#take-update');
        await loaded;
        await visit.tab.waitForSelector('html[data-gpu]');
        assert.equal(await visit.tab.$eval('#update', (note) => note.checkVisibility()), false);
    });
});
