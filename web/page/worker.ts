// Runs the engine, so that the page stays responsive and a match can be ended at any time.

import init, * as engine from 'engine';
import { broken, buffers, own, words } from './answers';
import type { Calls, Cameras, Device, Name, Picture, Range, Reply, Request } from './protocol';

declare const self: DedicatedWorkerGlobalScope;
/** The compiled engine beside this file; the build fills it in. */
declare const ENGINE: string;

let pair: engine.StereoPair | undefined;
let matched: engine.Matched | undefined;
/** What `matched` was made with. */
let made: { preset: string; range: Range } | undefined;
let cancelled = false;
const matchers = new Map<Device, engine.Matcher>();

async function matcher(device: Device): Promise<engine.Matcher> {
    const open = matchers.get(device) ?? (await engine.Matcher.open(device));
    matchers.set(device, open);
    return open;
}

/** What the engine calls a device whose name the browser hides. */
const UNNAMED = 'WebGPU';

/** The device's name for people. Browsers hide it, or tell of its maker and architecture alone, which the engine does not see. */
async function named(device: string): Promise<string> {
    if (device !== UNNAMED) {
        return device;
    }
    const gpu = (navigator as unknown as { gpu: { requestAdapter(): Promise<{ info?: Record<string, string> } | null> } }).gpu;
    const info = (await gpu.requestAdapter())?.info;
    const known = [info?.['vendor'], info?.['architecture']].filter(Boolean);
    return known.length > 0 ? `${known.join(' ')} (${UNNAMED})` : UNNAMED;
}

function need<T>(value: T | undefined, what: string): T {
    if (value === undefined) {
        throw new Error(`There is no ${what} yet.`);
    }
    return value;
}

/** Frees what `use` is given, whatever happens. */
async function using<T extends { free(): void }, R>(value: T, use: (value: T) => R | Promise<R>): Promise<R> {
    try {
        return await use(value);
    } finally {
        value.free();
    }
}

function picture(width: number, height: number, pixels: Uint8Array): Picture {
    return { width, height, pixels: new Uint8ClampedArray(own(pixels).buffer, pixels.byteOffset, pixels.length) };
}

async function run(device: Device, preset: string, range: Range): Promise<{ found: engine.Matched; took: number }> {
    cancelled = false;
    const [views, path] = [need(pair, 'pair'), await matcher(device)];
    const begun = performance.now();
    const progress = (stage: string, done: number) => {
        post({ stage, done });
        return !cancelled;
    };
    const found = await using(new engine.Range(range.min, range.max), (ends) => path.match(views, preset, ends, progress));
    if (found.note !== undefined && matchers.delete(device)) {
        // A device that failed is opened anew.
        path.free();
    }
    return { found, took: performance.now() - begun };
}

const cameras = ({ focalLength, cx, cy, doffs, baseline, unit }: Cameras) =>
    new engine.Cameras(focalLength, cx, cy, doffs, baseline, unit);

const bytes = async (file: Blob) => new Uint8Array(await file.arrayBuffer());

const calls: { [N in Name]: (...args: Parameters<Calls[N]>) => ReturnType<Calls[N]> | Promise<ReturnType<Calls[N]>> } = {
    async start() {
        await init({ module_or_path: new URL(ENGINE, self.location.href) });
        const scales = { turbo: engine.scale('turbo'), viridis: engine.scale('viridis'), grey: engine.scale('grey') };
        return { version: engine.version(), presets: engine.presets(), reasons: engine.reasons(), scales };
    },
    async open(device) {
        return named((await matcher(device)).device);
    },
    async pair(left, leftName, right, rightName) {
        pair?.free();
        matched?.free();
        pair = matched = undefined;
        pair = new engine.StereoPair(await bytes(left), leftName, await bytes(right), rightName);
        const { width, height } = pair;
        return {
            left: picture(width, height, pair.picture('left')),
            right: picture(width, height, pair.picture('right')),
        };
    },
    range() {
        const found = need(pair, 'pair').range();
        if (found === undefined) {
            return undefined;
        }
        const { min, max } = found;
        found.free();
        return { min, max };
    },
    warnings(range) {
        // This call takes the range and frees it.
        return need(pair, 'pair').warnings(range && new engine.Range(range.min, range.max));
    },
    async match(device, preset, range, colours) {
        matched?.free();
        matched = undefined;
        const { found, took } = await run(device, preset, range);
        [matched, made] = [found, { preset, range }];
        const { width, height, min, max, iterations, note } = found;
        return {
            ...{ width, height, range: { min, max }, iterations, device: await named(found.device), note, took },
            warnings: found.warnings(),
            disparity: own(found.disparity()),
            confidence: own(found.confidence()),
            validity: own(found.validity()),
            picture: picture(width, height, found.picture('disparity', colours)),
        };
    },
    async compare(device) {
        const first = need(matched, 'map');
        const { preset, range } = need(made, 'map');
        const { found, took } = await run(device, preset, range);
        const by = await named(found.device);
        return using(found, (other) => ({ device: by, note: other.note, differing: first.differing(other), took }));
    },
    picture(map, colours) {
        const { width, height } = need(matched, 'map');
        return picture(width, height, need(matched, 'map').picture(map, colours));
    },
    file(output) {
        const maps = need(matched, 'map');
        switch (output) {
            case 'pfm':
                return own(maps.pfm('disparity'));
            case 'raw':
                return own(maps.pfm('raw'));
            case 'png':
                return own(maps.png('disparity'));
            case 'confidence':
            case 'validity':
                return own(maps.png(output));
        }
    },
    cameras(calibration) {
        const read = engine.Cameras.read(calibration);
        const { focal_length, cx, cy, doffs, baseline, unit } = read;
        read.free();
        return { focalLength: focal_length, cx, cy, doffs, baseline, unit };
    },
    points(of) {
        return using(cameras(of), (rig) => {
            const points = need(matched, 'map').points(rig, need(pair, 'pair'));
            const { positions, colours, confidences, count } = points;
            points.free();
            return { positions: own(positions), colours: own(colours), confidences: own(confidences), count };
        });
    },
    ply(of, leastConfidence) {
        return using(cameras(of), (rig) => own(need(matched, 'map').ply(rig, need(pair, 'pair'), leastConfidence)));
    },
};

function post(reply: Reply): void {
    self.postMessage(reply, 'value' in reply ? buffers(reply.value) : []);
}

async function answer<N extends Name>(id: number, call: N, args: Parameters<Calls[N]>): Promise<void> {
    try {
        post({ id, value: await calls[call](...args) });
    } catch (error) {
        if (broken(error)) {
            post({ broken: words(error) });
        } else {
            post({ id, error: words(error), why: cancelled && words(error) === 'interrupted' ? 'interrupted' : 'refused' });
        }
    }
}

self.addEventListener('message', ({ data }: MessageEvent<Request>) => {
    if ('cancel' in data) {
        cancelled = true;
    } else {
        void answer(data.id, data.call, data.args as never);
    }
});

// A trap in what nothing awaits.
self.addEventListener('unhandledrejection', (event) => post({ broken: words(event.reason) }));
