// What a matcher and its worker say to each other. Each call has one answer; progress comes in between.

export interface Reason {
    /** The value of one bit of `reasons`; 0 is that of a pixel without any, which was measured and is trusted. */
    bit: number;
    name: string;
    about: string;
}

/** A view in memory: rows from the top without gaps, of 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) samples for each pixel. */
export interface View {
    data: Uint8Array | Uint8ClampedArray | Uint16Array;
    width: number;
    height: number;
}

/** What every `ImageBitmap` is; so the types need no library of a browser. */
export interface Bitmap {
    readonly width: number;
    readonly height: number;
    close(): void;
}

export interface Match {
    width: number;
    height: number;
    /** In pixels, row by row; +Infinity where there is none. */
    disparity: Float32Array;
    /** 0 to 255 for each pixel. */
    confidence: Uint8Array;
    /** Why each pixel is what it is: bits, which `Matcher.reasons` explains. */
    reasons: Uint8Array;
    /** The disparities that were searched, both ends included. */
    minDisparity: number;
    maxDisparity: number;
    /** What ran it, for people. */
    device: string;
    /** Why it did not run on the GPU, where one was to be taken. */
    note: string | undefined;
    /** What is probably wrong with the pair or the range, with the remedy. */
    warnings: string[];
}

/** What a worker says of the device that it has opened. */
export interface Opened {
    version: string;
    device: string;
    note: string | undefined;
    /** The names of all presets. */
    presets: string[];
    reasons: Reason[];
}

export interface Calls {
    open(device: 'auto' | 'cpu' | 'webgpu'): Opened;
    /** Without a range, the one that sparse matches find. */
    match(left: View, right: View, method: string, range: [number, number] | undefined): Match;
}

export type Request = { [N in keyof Calls]: { id: number; call: N; args: Parameters<Calls[N]> } }[keyof Calls];

export type Reply =
    | { id: number; value: ReturnType<Calls[keyof Calls]> }
    | { id: number; error: string }
    | { stage: string; done: number }
    /** The engine cannot go on: the worker is of no use any more. */
    | { broken: string };
