// The worker for Node.js.

import { readFile } from 'node:fs/promises';
import { parentPort } from 'node:worker_threads';
import init from 'engine';
import { answering } from './engine.js';

const answer = answering(
    async () => init({ module_or_path: await readFile(new URL('./mrfgs_web_bg.wasm', import.meta.url)) }),
    (reply, moved) => parentPort?.postMessage(reply, moved),
);
parentPort?.on('message', answer);
