// The worker in browsers.

import init from 'engine';
import { answering } from './engine.js';

declare const self: DedicatedWorkerGlobalScope;

const answer = answering(
    // Bundlers take the file along for the sake of this line.
    () => init({ module_or_path: new URL('./mrfgs_web_bg.wasm', import.meta.url) }),
    (reply, moved) => self.postMessage(reply, moved),
);
self.addEventListener('message', ({ data }) => answer(data));
// A trap in what nothing awaits.
self.addEventListener('unhandledrejection', ({ reason }) => self.postMessage({ broken: String(reason) }));
