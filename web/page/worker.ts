// Runs the engine, so that the page stays responsive and a match can be stopped at any time.

import init, * as engine from 'engine';
import { broken, buffers, own, words } from './answers';
import { painted } from './paint';
import type { Calls, Cameras, Device, Name, Pair, Picture, Prior, PriorUse, Range, Reply, Request, Size, Text, Warning } from './protocol';
import { spread } from './spread';

declare const self: DedicatedWorkerGlobalScope;
/** The compiled engine beside this file; inserted by the build. */
declare const ENGINE: string;

let pair: engine.StereoPair | undefined;
let matched: engine.Matched | undefined;
/** The settings that `matched` was made with. */
let made: { preset: string; range: Range; found: boolean; half: boolean; spread: Range } | undefined;
let cancelled = false;
const matchers = new Map<Device, engine.Matcher>();

async function matcher(device: Device): Promise<engine.Matcher> {
    const open = matchers.get(device) ?? (await engine.Matcher.open(device));
    matchers.set(device, open);
    return open;
}

/** Name of a device whose name the browser hides. */
const UNNAMED = 'WebGPU';

/** The display name of the device. Browsers hide it, or give only vendor and architecture, which the engine does not see. */
async function named(device: string): Promise<string> {
    if (device !== UNNAMED) {
        return device;
    }
    const gpu = (navigator as unknown as { gpu: { requestAdapter(): Promise<{ info?: Record<string, string> } | null> } }).gpu;
    const info = (await gpu.requestAdapter())?.info;
    const known = [info?.['vendor'], info?.['architecture']].filter(Boolean);
    return known.length > 0 ? `${known.join(' ')} (${UNNAMED})` : UNNAMED;
}

/** The colours of the frames of a video. */
let turbo: Uint8Array | undefined;
let video: engine.Video | undefined;
/** Resolves when no frame is being matched. */
let frames: Promise<unknown> = Promise.resolve();

/** Uses the video once it is free. */
function filmed<R>(use: (video: engine.Video) => R | Promise<R>): Promise<R> {
    const next = frames.then(() => use(need(video, 'video')));
    frames = next.catch(() => {});
    return next;
}

/** The pixels of an image, which is freed. */
function pixels(image: ImageBitmap): Uint8Array {
    const { width, height } = image;
    const context = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
    if (!context) {
        throw new Error(`The browser cannot hold a picture of ${width} × ${height} pixels.`);
    }
    context.drawImage(image, 0, 0);
    image.close();
    return new Uint8Array(context.getImageData(0, 0, width, height).data.buffer);
}

function need<T>(value: T | undefined, what: string): T {
    if (value === undefined) {
        throw new Error(`There is no ${what} yet.`);
    }
    return value;
}

/** Calls `use` with a value and frees it, even if it throws. */
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

/** Both views as pictures. */
function pictures(of: engine.StereoPair): Pair {
    const [left, right] = (['left', 'right'] as const).map((view) => picture(of.width, of.height, of.picture(view))) as [Picture, Picture];
    return { left, right };
}

/** Converts cameras of the engine, and frees them. */
function told(of: engine.Cameras | undefined): Cameras | undefined {
    if (!of) {
        return undefined;
    }
    const { focal_length, cx, cy, doffs, baseline, unit } = of;
    of.free();
    return { focalLength: focal_length, cx, cy, doffs, baseline, unit };
}

/** Converts a range of the engine, and frees it. */
function seen(found: engine.Range | undefined): Range | undefined {
    if (!found) {
        return undefined;
    }
    const { min, max } = found;
    found.free();
    return { min, max };
}

const known = (files: Text[]) => new engine.Known(files.map(({ name }) => name), files.map(({ text }) => text));

const ends = ({ min, max }: Range, found: boolean) => (found ? new engine.Range(min, max).found() : new engine.Range(min, max));

/** Whether to match at half size, and whether for lack of memory. */
async function halved(preset: string, range: Range, size: Size): Promise<{ half: boolean; short: boolean }> {
    if (size !== 'automatic') {
        return { half: size === 'half', short: false };
    }
    const short = await using(ends(range, false), (over) => {
        try {
            return engine.tiles(need(pair, 'pair'), preset, over, false) > 1;
        } catch (error) {
            if (broken(error)) {
                throw error;
            }
            // It does not fit even in tiles.
            return true;
        }
    });
    return { half: short, short };
}

async function run(device: Device, preset: string, range: Range, wide: boolean, half: boolean): Promise<{ found: engine.Matched; took: number }> {
    cancelled = false;
    const [views, path] = [need(pair, 'pair'), await matcher(device)];
    const begun = performance.now();
    const progress = (stage: string, done: number) => {
        post({ stage, done });
        return !cancelled;
    };
    const found = await using(ends(range, wide), (over) => path.match(views, preset, over, progress, half));
    if (found.note !== undefined && matchers.delete(device)) {
        // A device that failed is reopened.
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
        turbo = engine.scale('turbo');
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
        return pictures(pair);
    },
    async whole(files) {
        try {
            return await using(known(files), (of) => of.whole);
        } catch (error) {
            if (broken(error)) {
                throw error;
            }
            return false;
        }
    },
    calibration(files, width, height) {
        return using(known(files), (all) => {
            const found = all.rectified ? all.ofRectified(width, height) : undefined;
            return found && using(found, (of) => {
                need(pair, 'pair').takenBy(of);
                return {
                    range: of.labels ? { min: 0, max: of.labels - 1 } : undefined,
                    size: of.width && of.height ? { width: of.width, height: of.height } : undefined,
                    cameras: told(of.cameras()),
                    notes: of.doubts(width),
                };
            });
        });
    },
    async rectify(files) {
        const raw = need(pair, 'pair');
        const by = files ? await using(known(files), (of) => of.rectify(raw)) : engine.Rectified.byMatches(raw);
        const [notes, cameras] = [by.notes, told(by.cameras())];
        // This call consumes its object.
        pair = by.pair();
        raw.free();
        return { ...pictures(pair), notes, cameras };
    },
    async know(file, name) {
        return need(pair, 'pair').knowFile(await bytes(file), name) as Prior;
    },
    range() {
        return seen(need(pair, 'pair').range());
    },
    warnings(range) {
        // This call consumes the range.
        return need(pair, 'pair').warnings(range && new engine.Range(range.min, range.max)) as Warning[];
    },
    async match(device, preset, range, wide, size, colours) {
        const { half, short } = await halved(preset, range, size);
        const { found, took } = await run(device, preset, range, wide, half);
        // The last result is kept until there is another.
        matched?.free();
        const { width, height, min, max, iterations, note, corrected, tiles } = found;
        const [disparity, validity] = [own(found.disparity()), own(found.validity())];
        const shown = spread(disparity, validity, { min, max });
        [matched, made] = [found, { preset, range, found: wide, half, spread: shown }];
        return {
            ...{ width, height, range: { min, max }, iterations, device: await named(found.device), note, took, corrected, tiles, half, short },
            ...{ disparity, validity, spread: shown },
            warnings: found.warnings() as Warning[],
            prior: found.prior() as PriorUse | undefined,
            confidence: own(found.confidence()),
            picture: picture(width, height, found.picture('disparity', colours, shown.min, shown.max)),
        };
    },
    async compare(device) {
        const first = need(matched, 'map');
        const { preset, range, found: wide, half } = need(made, 'map');
        const { found, took } = await run(device, preset, range, wide, half);
        const by = await named(found.device);
        return using(found, (other) => ({ device: by, note: other.note, differing: first.differing(other), took }));
    },
    picture(map, colours) {
        const { width, height } = need(matched, 'map');
        const { min, max } = need(made, 'map').spread;
        return picture(width, height, need(matched, 'map').picture(map, colours, min, max));
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
    ply(of, leastConfidence) {
        return using(cameras(of), (rig) => own(need(matched, 'map').ply(rig, need(pair, 'pair'), leastConfidence)));
    },
    async video(device) {
        await calls.endVideo();
        video = await engine.Video.open(device);
        return named(video.device);
    },
    learn(left, right) {
        const { width, height } = left;
        return filmed((of) => of.learn(pixels(left), pixels(right), width, height));
    },
    frame(left, right) {
        return filmed(async (of) => {
            const { width, height } = left;
            const match = of.direct ? of.images(left, right) : of.pixels(pixels(left), pixels(right), width, height);
            return using(await match, (map) => {
                const range = need(seen(of.range), 'range');
                const disparity = own(map.disparity());
                const rectified = map.left();
                return {
                    ...{ range, disparity },
                    picture: painted(map.width, map.height, disparity, need(turbo, 'scale'), range),
                    left: rectified && picture(map.width, map.height, rectified),
                };
            });
        });
    },
    async endVideo() {
        await frames;
        video?.free();
        video = undefined;
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

// Reports a trap in a promise that nothing awaits.
self.addEventListener('unhandledrejection', (event) => post({ broken: words(event.reason) }));
