// What is under way: what begins ends what began before it.

/** One thing at a time. Who has awaited something asks the signal of its thing whether that still counts. */
export class Turns {
    private now = new AbortController();

    get signal(): AbortSignal {
        return this.now.signal;
    }

    /** Begins the next thing, which ends with `whole`, too, where it is a part of that. */
    next(whole?: AbortSignal): AbortSignal {
        this.now.abort();
        const begun = new AbortController();
        whole?.addEventListener('abort', () => begun.abort(), { once: true, signal: begun.signal });
        this.now = begun;
        return begun.signal;
    }
}
