// A visitor of the built page: a browser, a host, and actions with mouse and keyboard.
import assert from 'node:assert/strict';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { launch } from './browser.mjs';
import { SITE } from './paths.mjs';
import { serve } from './server.mjs';

/** Longer than any match on a software driver. */
const PATIENCE = 120_000;

export const BROWSER = process.env.MRFGS_BROWSER ?? 'chromium';

export class Visit {
    /** Opens the page and waits for the engine. */
    static async open(options = {}) {
        const visit = new Visit();
        visit.downloads = mkdtempSync(join(tmpdir(), 'mrfgs-downloads-'));
        visit.host = await serve({ '/some/folder/': SITE });
        visit.browser = await launch(BROWSER, { ...options, downloads: visit.downloads });
        await visit.page(options);
        return visit;
    }

    async page({ width = 1280, height = 800, before } = {}) {
        this.tab = await this.browser.newPage();
        await this.tab.setViewport({ width, height });
        /** Unexpected events: errors, violations of the Content-Security-Policy, requests to other hosts. */
        this.faults = [];
        this.tab.on('pageerror', (error) => this.faults.push(error.message));
        this.tab.on('console', (message) => {
            if (message.type() === 'error') {
                this.faults.push(message.text());
            }
        });
        this.tab.on('request', (request) => {
            if (!/^(blob|data):/.test(request.url()) && !request.url().startsWith(this.host.url)) {
                this.faults.push(`a request to ${request.url()}`);
            }
        });
        if (before) {
            await before(this);
        }
        await this.tab.goto(this.url);
        // The first view is matched before a GPU is looked for.
        await this.tab.waitForSelector('html[data-gpu]');
        await this.settled();
    }

    get url() {
        return `${this.host.url}/some/folder/`;
    }

    async close() {
        await this.browser.close();
        await this.host.stop();
        rmSync(this.downloads, { recursive: true, force: true });
        assert.deepEqual(this.faults, []);
    }

    /** Starts a match, and waits until it is in progress. */
    async begin() {
        await this.tab.click('#match');
        await this.state('matching');
        await this.tab.waitForFunction(() => document.getElementById('progress').value > 0.02);
    }

    /** Waits for one of these states. */
    async state(...states) {
        const now = () => this.tab.$eval('#app', (app) => app.dataset.state);
        try {
            await this.tab.waitForFunction((states) => states.includes(document.getElementById('app').dataset.state), { timeout: PATIENCE }, states);
        } catch {
            const said = await Promise.all(['#problem', '#stage'].map((selector) => this.text(selector)));
            assert.fail(`the page is ${await now()}, not ${states.join(' or ')}, and says ${JSON.stringify(said)}`);
        }
        return now();
    }

    /** Waits until nothing is running. */
    settled() {
        return this.state('empty', 'ready', 'done', 'failed');
    }

    text(selector) {
        return this.tab.$eval(selector, (element) => element.textContent);
    }

    /** Waits for a text that matches, and returns it. */
    async says(selector, pattern) {
        const [source, flags] = [pattern.source, pattern.flags];
        const found = (selector, source, flags) => {
            const element = document.querySelector(selector);
            return element?.checkVisibility() && new RegExp(source, flags).test(element.textContent);
        };
        try {
            await this.tab.waitForFunction(found, { timeout: 60_000 }, selector, source, flags);
        } catch {
            assert.fail(`${selector} says ${JSON.stringify(await this.text(selector))}, not ${pattern}`);
        }
        return this.text(selector);
    }

    async choose(side, ...paths) {
        await (await this.tab.$(`#${side}-file`)).uploadFile(...paths);
    }

    /**
     * Drops or pastes files, `{ name, path }`, anywhere or on a slot; pasting no files pastes text. `{ folder, files }` is dropped as a folder,
     * in which files without a path cannot be read.
     */
    give(way, files, slot) {
        const packed = ({ name, path, folder, files }) => (files ? { folder, files: files.map(packed) } : { name, content: path && readFileSync(path, 'base64') });
        return this.tab.evaluate((files, way, slot) => {
            const made = ({ name, content }) => new File([Uint8Array.from(atob(content), (c) => c.charCodeAt(0))], name);
            const gone = new DOMException('it is gone', 'NotFoundError');
            const entry = ({ folder, name, content, files }) => {
                const inside = files?.map(entry);
                const directory = { isDirectory: true, name: folder, createReader: () => ({ readEntries: (take) => take(inside.splice(0, 3)) }) };
                return folder ? directory : { isFile: true, name, file: (take, refuse) => (content === undefined ? refuse(gone) : take(made({ name, content }))) };
            };
            const transfer = new DataTransfer();
            const properties = { bubbles: true, cancelable: true };
            let events;
            if (way === 'pasted') {
                files.forEach((file) => transfer.items.add(made(file)));
                if (files.length === 0) {
                    transfer.setData('text/plain', 'words');
                }
                // Firefox does not let scripts create events with files.
                events = [Object.defineProperty(new Event('paste', properties), 'clipboardData', { value: transfer })];
            } else if (files.some(({ folder }) => folder)) {
                const items = files.map((file) => ({ webkitGetAsEntry: () => entry(file) }));
                const dataTransfer = { types: ['Files'], files: [], items };
                events = [Object.defineProperty(new Event('drop', properties), 'dataTransfer', { value: dataTransfer })];
            } else {
                files.forEach((file) => transfer.items.add(made(file)));
                events = ['dragover', 'drop'].map((type) => new DragEvent(type, { dataTransfer: transfer, ...properties }));
            }
            const at = slot ? document.getElementById(slot) : document.body;
            events.forEach((event) => at.dispatchEvent(event));
        }, files.map(packed), way, slot);
    }

    /** Delays all file reads in the page until `release`; with `first` only the next one. */
    holdFiles(first = false) {
        return this.tab.evaluate((first) => {
            const real = Blob.prototype.arrayBuffer;
            const back = () => (Blob.prototype.arrayBuffer = real);
            const held = new Promise((resolve) => (window.release = () => resolve(back())));
            Blob.prototype.arrayBuffer = async function () {
                if (first) {
                    back();
                }
                await held;
                return real.call(this);
            };
        }, first);
    }

    /** Delays the calls of this name to the worker until `release`. */
    holdCalls(name) {
        return this.tab.evaluate((name) => {
            const real = Worker.prototype.postMessage;
            const held = [];
            window.release = () => {
                Worker.prototype.postMessage = real;
                held.forEach((send) => send());
            };
            Worker.prototype.postMessage = function (...message) {
                const send = () => real.apply(this, message);
                if (message[0].call === name) {
                    held.push(send);
                    window.held = name;
                } else {
                    send();
                }
            };
        }, name);
    }

    /** Waits until a call of this name is held. */
    async holds(name) {
        await this.tab.waitForFunction((name) => window.held === name, {}, name);
    }

    release() {
        return this.tab.evaluate(() => window.release());
    }

    /** Starts counting the workers that are created. */
    async countWorkers() {
        await this.tab.evaluate(() => {
            const Real = Worker;
            window.workers = 0;
            window.Worker = class extends Real {
                constructor(...options) {
                    super(...options);
                    window.workers += 1;
                }
            };
        });
        return () => this.tab.evaluate(() => window.workers);
    }

    /** The names in both slots. */
    names() {
        return Promise.all(['#left .name', '#right .name'].map((selector) => this.text(selector)));
    }

    /** Changes the pair, waits until the page has processed it, and returns the state. */
    async changed(action) {
        const before = await this.tab.$eval('#app', (app) => Number(app.dataset.turn ?? 0));
        await action();
        const later = (before) => Number(document.getElementById('app').dataset.turn ?? 0) > before;
        await this.tab.waitForFunction(later, { timeout: PATIENCE }, before);
        return this.settled();
    }

    /** Chooses the views of a folder, and further files. */
    async pair(folder, ...also) {
        const state = await this.changed(() => this.choose('left', join(folder, 'im0.png'), join(folder, 'im1.png'), ...also));
        assert.equal(state, 'done', await this.text('#pair-problem'));
    }

    /** Opens a rendered scene, which is matched. */
    async scene(name) {
        await this.changed(() => this.tab.click(`[data-scene=${name}]`));
        // The pair is read first, then matched.
        return this.state('done', 'empty', 'failed');
    }

    async set({ preset, device, range }) {
        if (preset) {
            await this.tab.select('#preset', preset);
        }
        if (device) {
            await this.tab.click(`input[name=device][value=${device}]`);
        }
        if (range === 'automatic') {
            await this.tab.click('input[value=automatic]');
        } else if (range) {
            await this.tab.click('input[value=given]');
            await this.tab.$eval('#ends', (_, [min, max]) => {
                for (const [id, value] of [['min', min], ['max', max]]) {
                    const input = document.getElementById(id);
                    input.value = value;
                    input.dispatchEvent(new Event('change'));
                }
            }, range);
        }
    }

    /** Matches and waits for the result. */
    async match(settings = {}) {
        await this.set(settings);
        await this.tab.click('#match');
        await this.state('matching', 'done');
        await this.state('done', 'ready');
        assert.equal(await this.state('done', 'ready'), 'done', await this.text('#problem'));
    }

    /** The length of a film in seconds. */
    length(film) {
        return this.tab.evaluate(async (base64) => {
            const url = URL.createObjectURL(new Blob([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))]));
            const video = Object.assign(document.createElement('video'), { muted: true, src: url });
            await new Promise((resolve, reject) => ([video.onloadeddata, video.onerror] = [resolve, () => reject(new Error(video.error.message))]));
            // The length of a recording is known once its end has been sought.
            video.currentTime = 1e9;
            await new Promise((resolve) => (video.onseeked = resolve));
            return video.currentTime;
        }, film.toString('base64'));
    }

    /** Clicks a download, waits for the file, and returns its name and bytes. */
    save(output) {
        return this.download(() => this.tab.click(`#downloads [data-output=${output}]`));
    }

    /** The next file that is downloaded after an action. */
    async download(act) {
        for (const file of readdirSync(this.downloads)) {
            rmSync(join(this.downloads, file));
        }
        await act();
        for (;;) {
            const [name] = readdirSync(this.downloads).filter((file) => !/\.(part|crdownload|tmp)$|^\./.test(file));
            // Firefox first creates an empty file, then fills another.
            const partial = readdirSync(this.downloads).length > 1;
            if (name && !partial && existsSync(join(this.downloads, name))) {
                const bytes = readFileSync(join(this.downloads, name));
                if (bytes.length > 0) {
                    return { name, bytes };
                }
            }
            assert.equal(await this.text('#save-problem'), '');
            // One frame of the page.
            await this.tab.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
        }
    }
}
