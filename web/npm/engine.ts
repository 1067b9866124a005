// The worker's side: runs the engine and answers calls.

import * as engine from 'engine';
import { broken, buffers, own, words } from '../page/answers.js';
import type { Calls, Known, Opened, PriorUse, Reason, Reply, Request, View } from './calls.js';

/** Returns a handler of requests, which loads the engine with `load` first. */
export function answering(load: () => Promise<unknown>, post: (reply: Reply, moved: ArrayBuffer[]) => void): (request: Request) => void {
    let matcher: engine.Matcher | undefined;

    async function open(device: string): Promise<Opened> {
        await load();
        engine.for_package();
        let note: string | undefined;
        if (device !== 'cpu') {
            try {
                matcher = await engine.Matcher.open('gpu');
            } catch (error) {
                if (device === 'webgpu' || broken(error)) {
                    throw error;
                }
                note = words(error);
            }
        }
        matcher ??= await engine.Matcher.open('cpu');
        const reasons = (engine.reasons() as Reason[]).map(({ bit, name, about }) => ({ bit, name, about }));
        const presets = (engine.presets() as { name: string }[]).map(({ name }) => name);
        return { version: engine.version(), device: matcher.device, note, presets, reasons };
    }

    async function match(...[left, right, method, given, known]: Parameters<Calls['match']>): Promise<ReturnType<Calls['match']>> {
        if (matcher === undefined) {
            throw new Error('the matcher is not open');
        }
        const held: { free(): void }[] = [];
        const keep = <T extends { free(): void }>(value: T): T => (held.push(value), value);
        try {
            const pair = keep(pairOf(left, right));
            know(pair, known);
            const range = given ? new engine.Range(...given) : pair.range();
            if (range === undefined) {
                throw new Error('the disparity range cannot be determined: give minDisparity and maxDisparity');
            }
            keep(range);
            const warnings = pair.warnings(given && new engine.Range(...given)) as { text: string }[];
            const progress = (stage: string, done: number) => {
                post({ stage, done }, []);
                return true;
            };
            const found = keep(await matcher.match(pair, method, range, progress));
            const { width, height, min, max, device, note } = found;
            return {
                ...{ width, height, minDisparity: min, maxDisparity: max, device, note },
                warnings: [...new Set([...warnings, ...(found.warnings() as { text: string }[])].map(({ text }) => text))],
                prior: found.prior() as PriorUse | undefined,
                disparity: own(found.disparity()),
                confidence: own(found.confidence()),
                reasons: own(found.validity()),
            };
        } finally {
            for (const value of held) {
                try {
                    value.free();
                } catch {
                    // After a trap nothing can be freed; the error of the trap is reported.
                }
            }
        }
    }

    const calls = { open, match };
    return async ({ id, call, args }) => {
        try {
            const value = await (calls[call] as (...args: unknown[]) => Promise<ReturnType<Calls[typeof call]>>)(...args);
            post({ id, value }, buffers(value));
        } catch (error) {
            post(broken(error) ? { broken: words(error) } : { id, error: words(error) }, []);
        }
    };
}

function know(pair: engine.StereoPair, known: Known | undefined): void {
    if (known && 'points' in known) {
        pair.knowPoints(known.points, known.sigma);
    } else if (known) {
        pair.knowMap(known.disparity, known.sigma, known.sigmas, known.kind);
    }
}

function pairOf(left: View, right: View): engine.StereoPair {
    const sizes = [left.width, left.height, right.width, right.height] as const;
    const [l, r] = [left.data, right.data];
    if (l instanceof Uint16Array && r instanceof Uint16Array) {
        return engine.StereoPair.of_samples16(l, sizes[0], sizes[1], r, sizes[2], sizes[3]);
    }
    if (l instanceof Uint16Array || r instanceof Uint16Array) {
        throw new Error('one image has 8 bits and the other 16: give both in the same format');
    }
    const bytes = (data: Uint8Array | Uint8ClampedArray) => new Uint8Array(data.buffer, data.byteOffset, data.length);
    return engine.StereoPair.of_samples8(bytes(l), sizes[0], sizes[1], bytes(r), sizes[2], sizes[3]);
}
