// The package for browsers.

import { type Matcher, type Options, opened } from './matcher.js';

export type { Bitmap, Match, MatchOptions, Matcher, Options, Prior, PriorMap, PriorPoints, PriorUse, Reason, View } from './matcher.js';

/** Starts a worker with the engine and opens the device. */
export function createMatcher(options: Options = {}): Promise<Matcher> {
    return opened((hear, fail) => {
        // Bundlers detect the worker by this expression.
        const worker = new Worker(new URL('./worker.js', import.meta.url), { type: 'module', name: 'mrfgs' });
        worker.addEventListener('message', ({ data }) => hear(data));
        worker.addEventListener('error', (event) => fail(event.message || 'it did not start'));
        return { post: (request) => worker.postMessage(request), busy: () => {}, end: () => worker.terminate() };
    }, options);
}
