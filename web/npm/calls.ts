// Messages between a matcher and its worker. Each call has one reply; progress messages may precede it.

export interface Reason {
    /** One bit of `reasons` as a value; 0 stands for pixels without flags, which were measured and are reliable. */
    bit: number;
    name: string;
    about: string;
}

/** An image in memory: rows from the top without gaps, with 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) samples per pixel. */
export interface View {
    data: Uint8Array | Uint8ClampedArray | Uint16Array;
    width: number;
    height: number;
}

/** The interface of `ImageBitmap`, declared here so that the types do not require the DOM library. */
export interface Bitmap {
    readonly width: number;
    readonly height: number;
    close(): void;
}

/** How much of a prior a match has used. */
export interface PriorUse {
    kind: 'points' | 'surface';
    /** Number of pixels for which a disparity was given. */
    given: number;
    /** Number of these that their neighbours contradict; they were dropped. */
    dropped: number;
    /** How well the images agree with it, 0 to 1. Where they contradict it, it counts less; at 0 it was not used at all. */
    trust: number;
}

/** What is known of the left view, as the engine takes it: x, y, disparity and sigma of each point (a sigma of 0 is not given), or maps. */
export type Known = { sigma: number | undefined } & (
    | { points: Float64Array }
    | { disparity: Float32Array; sigmas: Float32Array | undefined; kind: 'points' | 'surface' | undefined }
);

export interface Match {
    width: number;
    height: number;
    /** In pixels, row by row; +Infinity where missing. */
    disparity: Float32Array;
    /** 0 to 255 for each pixel. */
    confidence: Uint8Array;
    /** Flags of each pixel: `Matcher.reasons` explains the bits. */
    reasons: Uint8Array;
    /** The range of disparities searched, inclusive. */
    minDisparity: number;
    maxDisparity: number;
    /** The device that ran the match, for display. */
    device: string;
    /** Why the match did not run on the GPU, if it was to. */
    note: string | undefined;
    /** How much of `prior` was used; undefined without one. */
    prior: PriorUse | undefined;
    /** Likely problems of the pair, the range or the prior, with remedies. */
    warnings: string[];
}

/** The properties of the opened device and the engine. */
export interface Opened {
    version: string;
    device: string;
    note: string | undefined;
    /** Names of all presets. */
    presets: string[];
    reasons: Reason[];
}

export interface Calls {
    open(device: 'auto' | 'cpu' | 'webgpu'): Opened;
    /** Matches over the range, or over the one found by sparse matching if none is given. */
    match(left: View, right: View, method: string, range: [number, number] | undefined, known: Known | undefined): Match;
}

export type Request = { [N in keyof Calls]: { id: number; call: N; args: Parameters<Calls[N]> } }[keyof Calls];

export type Reply =
    | { id: number; value: ReturnType<Calls[keyof Calls]> }
    | { id: number; error: string }
    | { stage: string; done: number }
    /** The engine has crashed, and the worker must be replaced. */
    | { broken: string };
