// The worker for browsers.

import init from 'engine';
import { answering } from './engine.js';

declare const self: DedicatedWorkerGlobalScope;

const answer = answering(
    // Bundlers include the file because of this expression.
    () => init({ module_or_path: new URL('./mrfgs_web_bg.wasm', import.meta.url) }),
    (reply, moved) => self.postMessage(reply, moved),
);
self.addEventListener('message', ({ data }) => answer(data));
// Reports a trap in a promise that nothing awaits.
self.addEventListener('unhandledrejection', ({ reason }) => self.postMessage({ broken: String(reason) }));
