// The page's end of the worker: turns calls into promises, and replaces a worker that crashed or does not stop.

import { words } from './dom';
import type { Calls, Facts, Name, Reply, Request } from './protocol';

/** The user stopped the call. */
export class Interrupted extends Error {}

/** The worker crashed and was replaced; the pair and maps that it held are lost. */
export class Broken extends Error {}

/** The message for an error. */
export function explained(error: unknown): string {
    const memory = /memory|allocation|unreachable|out of bounds/i.test(words(error));
    return error instanceof Broken
        ? `The engine ended (${words(error)}) and was started again. ${memory ? 'It ran out of memory, most likely: try smaller views or a smaller range.' : ''}`.trim()
        : words(error);
}

/** Time in ms in which a worker must stop before it is replaced. */
const PATIENCE = 2500;

interface Waiting {
    name: Name;
    resolve(value: never): void;
    reject(error: Error): void;
}

export class Client {
    /** Called with the current stage and the fraction of the match done, 0 to 1. */
    onProgress: (stage: string, done: number) => void = () => {};
    /** Number of workers before this one; data held by earlier ones is lost. */
    generation = 0;
    /** Properties of the engine, once it is loaded. */
    facts: Promise<Facts>;
    private worker!: Worker;
    private started = false;
    private waiting = new Map<number, Waiting>();
    private last = 0;
    /** Called when a call has ended. */
    private ended: (() => void)[] = [];

    constructor(private readonly script: URL) {
        this.facts = this.hire();
    }

    /** Calls the worker, once it has started. */
    async call<N extends Name>(name: N, ...args: Parameters<Calls[N]>): Promise<ReturnType<Calls[N]>> {
        await this.facts;
        return this.send(name, ...args);
    }

    /** A `call` that is cancelled by `signal`: it then sends nothing and ignores replies. */
    within(signal: AbortSignal): Client['call'] {
        return async (name, ...args) => {
            signal.throwIfAborted();
            await this.facts;
            signal.throwIfAborted();
            try {
                return await this.send(name, ...args);
            } finally {
                signal.throwIfAborted();
            }
        };
    }

    /** Cancels all calls except those that open a device; a worker that does not respond in time is replaced. */
    async cancel(): Promise<void> {
        const calls = [...this.waiting].filter(([, { name }]) => name !== 'open').map(([id]) => id);
        if (!this.started || calls.length === 0) {
            return;
        }
        this.worker.postMessage({ cancel: true } satisfies Request);
        const patience = setTimeout(() => this.replace(new Interrupted('interrupted')), PATIENCE);
        while (calls.some((id) => this.waiting.has(id))) {
            await new Promise<void>((resolve) => this.ended.push(resolve));
        }
        clearTimeout(patience);
    }

    private send<N extends Name>(name: N, ...args: Parameters<Calls[N]>): Promise<ReturnType<Calls[N]>> {
        const id = ++this.last;
        return new Promise((resolve, reject) => {
            this.waiting.set(id, { name, resolve, reject });
            const images = args.filter((arg): arg is never => arg instanceof ImageBitmap);
            this.worker.postMessage({ id, call: name, args } as Request, images);
        });
    }

    private hire(): Promise<Facts> {
        const worker = new Worker(this.script, { type: 'module', name: 'mrfgs' });
        this.worker = worker;
        this.started = false;
        worker.addEventListener('message', ({ data }: MessageEvent<Reply>) => {
            // Messages from a replaced worker are ignored.
            if (worker === this.worker) {
                this.take(data);
            }
        });
        worker.addEventListener('error', (event) => {
            event.preventDefault();
            if (worker === this.worker) {
                this.replace(new Broken(event.message || 'its worker did not start'));
            }
        });
        const facts = this.send('start');
        facts.then(
            () => (this.started = true),
            () => {},
        );
        return facts;
    }

    private take(reply: Reply): void {
        if ('broken' in reply) {
            this.replace(new Broken(reply.broken));
        } else if ('stage' in reply) {
            this.onProgress(reply.stage, reply.done);
        } else {
            const waiting = this.waiting.get(reply.id);
            this.waiting.delete(reply.id);
            if ('value' in reply) {
                waiting?.resolve(reply.value as never);
            } else {
                waiting?.reject(reply.why === 'interrupted' ? new Interrupted(reply.error) : new Error(reply.error));
            }
            this.tell();
        }
    }

    private replace(reason: Error): void {
        this.worker.terminate();
        const waiting = [...this.waiting.values()];
        this.waiting.clear();
        // A worker that failed to start is not restarted.
        if (this.started) {
            this.generation += 1;
            this.facts = this.hire();
        }
        for (const { reject } of waiting) {
            reject(reason);
        }
        this.tell();
    }

    private tell(): void {
        this.ended.splice(0).forEach((resume) => resume());
    }
}
