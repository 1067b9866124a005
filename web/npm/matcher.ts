// The matcher that programs use, and its end of the worker's messages.

import type { Bitmap, Calls, Known, Match, Opened, PriorUse, Reason, Reply, Request, View } from './calls.js';

export type { Bitmap, Match, PriorUse, Reason, View };

export interface Options {
    /** A preset: `default`, `accurate`, `fast`, `paper` or `fgs`. */
    method?: 'default' | 'accurate' | 'fast' | 'paper' | 'fgs';
    /** `auto` uses WebGPU if available, and otherwise the CPU. Node.js has only the CPU. */
    device?: 'auto' | 'cpu' | 'webgpu';
}

/** Known disparities of the left view, in pixels: points, or a map of its size. */
export type Prior = PriorPoints | PriorMap;

/** Sparse, exact points: they are cleaned and spread, and decide where no match can be trusted. */
export interface PriorPoints {
    /** Rows of x, y, disparity, and perhaps the standard deviation; or these numbers in one array, three for each point. */
    points: ArrayLike<ArrayLike<number>> | ArrayLike<number>;
    /** The standard deviation of points without one of their own; by default 0.25. */
    sigma?: number;
}

export interface PriorMap {
    /** Row by row, NaN or Infinity where nothing is known. */
    disparity: Float32Array;
    /** The standard deviation, for all or for each pixel; by default 0.25 for points and 1 for a surface. */
    sigma?: number | Float32Array;
    /** A surface is dense but coarse, and only shifts the balance between disparities. By default points if at most a fifth is known. */
    kind?: 'points' | 'surface';
}

export interface MatchOptions {
    /** The disparities to search, in pixels, inclusive. Without `maxDisparity`, sparse matching finds the range. */
    minDisparity?: number;
    maxDisparity?: number;
    /** What is known of the left view beforehand. */
    prior?: Prior;
    /** Aborts the match by ending the worker; the next match starts another one. */
    signal?: AbortSignal;
    /** Called with the fraction of the match done, 0 to 1. */
    onProgress?: (done: number, stage: string) => void;
}

/** A worker of a browser or of Node.js. */
export interface Port {
    post(request: Request): void;
    /** Whether the process must stay alive for it. */
    busy(is: boolean): void;
    end(): void;
}

export type Start = (hear: (reply: Reply) => void, fail: (reason: string) => void) => Port;

const DEVICES = ['auto', 'cpu', 'webgpu'];
const KINDS = ['points', 'surface'];

export class Matcher {
    /** The version of mrfgs. */
    readonly version: string;
    /** Explanation of the bits in a match's `reasons`. */
    readonly reasons: readonly Reason[];
    /** The device that runs matches, for display. */
    readonly device: string;
    /** Why it is not the GPU, if `auto` found none. */
    readonly note: string | undefined;
    private queue: Promise<unknown> = Promise.resolve();

    /** Use `createMatcher` instead. */
    constructor(
        private readonly link: Link,
        private readonly method: string,
        { version, reasons, device, note }: Opened,
    ) {
        this.version = version;
        this.reasons = reasons;
        this.device = device;
        this.note = note;
    }

    /** Matches a rectified pair. Concurrent calls run one after another. */
    match(left: View | Bitmap, right: View | Bitmap, options: MatchOptions = {}): Promise<Match> {
        const next = this.queue.then(() => this.run(left, right, options));
        this.queue = next.catch(() => {});
        return next;
    }

    /** Ends the worker and frees its memory. A running match fails. */
    close(): void {
        this.link.close();
    }

    private async run(left: View | Bitmap, right: View | Bitmap, options: MatchOptions): Promise<Match> {
        const { minDisparity = 0, maxDisparity, prior, signal, onProgress } = options;
        for (const [name, value] of Object.entries({ minDisparity, maxDisparity })) {
            if (value !== undefined && !Number.isSafeInteger(value)) {
                throw new TypeError(`${name} is ${String(value)}: give a whole number of pixels`);
            }
        }
        if (maxDisparity === undefined && options.minDisparity !== undefined) {
            throw new TypeError('minDisparity is given without maxDisparity: give both, or none');
        }
        const range: [number, number] | undefined = maxDisparity === undefined ? undefined : [minDisparity, maxDisparity];
        const views = [viewOf(left, 'left'), viewOf(right, 'right')] as const;
        const known = prior === undefined ? undefined : knownBy(prior, views[0]);
        signal?.throwIfAborted();
        const stop = () => this.link.fail(signal?.reason);
        signal?.addEventListener('abort', stop);
        this.link.onProgress = onProgress;
        try {
            return await this.link.call('match', ...views, this.method, range, known);
        } finally {
            this.link.onProgress = undefined;
            signal?.removeEventListener('abort', stop);
        }
    }
}

/** Turns calls into promises, and replaces a worker that crashed or was ended. */
export class Link {
    onProgress: MatchOptions['onProgress'];
    private port: Port | undefined;
    private waiting = new Map<number, { resolve(value: never): void; reject(reason: unknown): void }>();
    private last = 0;
    private closed = false;

    constructor(
        private readonly start: Start,
        private readonly device: 'auto' | 'cpu' | 'webgpu',
    ) {}

    open(): Promise<Opened> {
        const port: Port = this.start(
            // Messages from an ended worker are ignored.
            (reply) => port === this.port && this.hear(reply),
            (reason) => port === this.port && this.fail(new Error(`the worker of @mrfgs/wasm failed: ${reason}`)),
        );
        this.port = port;
        return this.send('open', this.device);
    }

    async call<N extends keyof Calls>(name: N, ...args: Parameters<Calls[N]>): Promise<ReturnType<Calls[N]>> {
        if (this.closed) {
            throw new Error('the matcher is closed: create another');
        }
        if (this.port === undefined) {
            await this.open();
        }
        return this.send(name, ...args);
    }

    /** Ends the worker and rejects all pending calls. */
    fail(reason: unknown): void {
        this.port?.end();
        this.port = undefined;
        const waiting = [...this.waiting.values()];
        this.waiting.clear();
        for (const { reject } of waiting) {
            reject(reason);
        }
    }

    close(): void {
        this.closed = true;
        this.fail(new Error('the matcher was closed'));
    }

    private send<N extends keyof Calls>(call: N, ...args: Parameters<Calls[N]>): Promise<ReturnType<Calls[N]>> {
        const id = ++this.last;
        return new Promise((resolve, reject) => {
            this.waiting.set(id, { resolve, reject });
            this.port?.busy(true);
            this.port?.post({ id, call, args } as Request);
        });
    }

    private hear(reply: Reply): void {
        if ('broken' in reply) {
            this.fail(new Error(`the engine of @mrfgs/wasm crashed: ${reply.broken}`));
        } else if ('stage' in reply) {
            this.onProgress?.(reply.done, reply.stage);
        } else {
            const waiting = this.waiting.get(reply.id);
            this.waiting.delete(reply.id);
            this.port?.busy(this.waiting.size > 0);
            if ('value' in reply) {
                waiting?.resolve(reply.value as never);
            } else {
                waiting?.reject(new Error(reply.error));
            }
        }
    }
}

/** Creates a matcher with a worker started by `start`. */
export async function opened(start: Start, { method = 'default', device = 'auto' }: Options): Promise<Matcher> {
    known('device', device, DEVICES);
    const link = new Link(start, device);
    try {
        const told = await link.open();
        known('method', method, told.presets);
        return new Matcher(link, method, told);
    } catch (error) {
        link.close();
        throw error;
    }
}

function known(name: string, value: string, all: readonly string[]): void {
    if (!all.includes(value)) {
        throw new TypeError(`${name} is ${JSON.stringify(value)}: use ${all.join(', ')}`);
    }
}

/** Checks the form of a prior of this view; the engine checks the values. */
function knownBy(prior: Prior, { width, height }: View): Known {
    const { points, disparity, sigma, kind } = (prior ?? {}) as Partial<Pick<PriorPoints, 'points'> & PriorMap>;
    if ((points === undefined) === (disparity === undefined)) {
        throw new TypeError('prior: give either points or disparity');
    }
    if (sigma !== undefined && !(sigma instanceof Float32Array) && !(Number.isFinite(sigma) && sigma > 0)) {
        throw new TypeError(`prior.sigma is ${String(sigma)}: give pixels above 0`);
    }
    if (kind !== undefined && !KINDS.includes(kind)) {
        throw new TypeError(`prior.kind is ${JSON.stringify(kind)}: use ${KINDS.join(', ')}`);
    }
    if (points !== undefined) {
        if (sigma instanceof Float32Array || kind === 'surface') {
            throw new TypeError('prior: points have a sigma of their own or one for all, and are no surface');
        }
        return { points: rowsOf(points), sigma };
    }
    const sigmas = sigma instanceof Float32Array ? sigma : undefined;
    for (const [name, map] of Object.entries({ disparity, sigma: sigmas ?? disparity })) {
        if (!(map instanceof Float32Array) || map.length !== width * height) {
            throw new TypeError(`prior.${name}: give a Float32Array of ${width} x ${height} values, as the left view has pixels`);
        }
    }
    return { disparity: disparity as Float32Array, sigmas, sigma: sigmas ? undefined : (sigma as number | undefined), kind };
}

/** x, y, disparity and sigma of each point, where 0 stands for no sigma. */
function rowsOf(points: PriorPoints['points']): Float64Array {
    const wrong = new TypeError('prior.points: give rows of x, y, disparity, and perhaps sigma, or three numbers for each point');
    if (typeof points !== 'object' || points === null || !Number.isSafeInteger(points.length)) {
        throw wrong;
    }
    const flat = typeof points[0] === 'number';
    const count = flat ? points.length / 3 : points.length;
    if (!Number.isInteger(count)) {
        throw wrong;
    }
    const values = new Float64Array(4 * count);
    for (let i = 0; i < count; i += 1) {
        const row = (flat ? Array.prototype.slice.call(points, 3 * i, 3 * i + 3) : points[i]) as ArrayLike<number> | undefined;
        if (row === undefined || row === null || (row.length !== 3 && row.length !== 4)) {
            throw wrong;
        }
        // The engine refuses what is not a number.
        values.set(Array.from(row, (value) => (typeof value === 'number' ? value : NaN)), 4 * i);
        if (row.length === 4 && values[4 * i + 3] === 0) {
            throw new TypeError(`prior.points: point ${i + 1} has a sigma of 0: give pixels above 0, or none`);
        }
    }
    return values;
}

function viewOf(view: View | Bitmap, name: string): View {
    if (typeof ImageBitmap !== 'undefined' && view instanceof ImageBitmap) {
        const { width, height } = view;
        const context = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
        if (context === null) {
            throw new Error(`${name}: this browser cannot read an ImageBitmap: give its ImageData`);
        }
        context.drawImage(view, 0, 0);
        return viewOf(context.getImageData(0, 0, width, height), name);
    }
    const { data, width, height } = (view ?? {}) as Partial<View>;
    if (!(data instanceof Uint8Array || data instanceof Uint8ClampedArray || data instanceof Uint16Array)) {
        throw new TypeError(`${name}: give ImageData, an ImageBitmap, or { data, width, height } with data of 8 or 16 bits`);
    }
    const channels = data.length / (Number(width) * Number(height));
    if (![1, 2, 3, 4].includes(channels)) {
        throw new TypeError(`${name}: ${data.length} samples do not fit ${String(width)} x ${String(height)} pixels with 1 to 4 samples each`);
    }
    return { data, width: Number(width), height: Number(height) };
}
