// Tasks of which a new one cancels the previous one.

/** One task at a time. Code that has awaited something checks the signal of its task before it goes on. */
export class Turns {
    private now = new AbortController();

    get signal(): AbortSignal {
        return this.now.signal;
    }

    /** Starts the next task, which also ends with `whole` if it is part of another one. */
    next(whole?: AbortSignal): AbortSignal {
        this.now.abort();
        const begun = new AbortController();
        whole?.addEventListener('abort', () => begun.abort(), { once: true, signal: begun.signal });
        this.now = begun;
        return begun.signal;
    }
}
