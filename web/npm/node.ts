// The package for Node.js, which matches on the CPU.

import { Worker } from 'node:worker_threads';
import { type Matcher, type Options, opened } from './matcher.js';

export type { Bitmap, Match, MatchOptions, Matcher, Options, Prior, PriorMap, PriorPoints, PriorUse, Reason, View } from './matcher.js';

/** Starts a worker thread with the engine. */
export async function createMatcher(options: Options = {}): Promise<Matcher> {
    if (options.device === 'webgpu') {
        throw new TypeError("device is \"webgpu\", which Node.js does not have: use 'cpu' or 'auto'");
    }
    return opened((hear, fail) => {
        const worker = new Worker(new URL('./worker-node.js', import.meta.url), { name: 'mrfgs' });
        worker.on('message', hear);
        worker.on('error', (error) => fail(error instanceof Error ? error.message : String(error)));
        return {
            post: (request) => worker.postMessage(request),
            // An idle worker does not keep the process alive, even without `close`.
            busy: (is) => (is ? worker.ref() : worker.unref()),
            end: () => void worker.terminate(),
        };
    }, { ...options, device: options.device === 'auto' ? 'cpu' : (options.device ?? 'cpu') });
}
