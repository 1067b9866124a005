// What page and worker say to each other. Each call has one answer; progress comes in between.

export type Device = 'gpu' | 'cpu';
export type Colours = 'turbo' | 'viridis' | 'grey';
/** The maps that are shown as pictures. */
export type Map = 'disparity' | 'confidence' | 'validity';
/** What can be saved: words of `mrfgs match --also`, and the map itself in both formats. */
export type Output = 'pfm' | 'raw' | 'png' | 'confidence' | 'validity';

export interface Preset {
    name: string;
    about: string;
}

/** One bit of the validity map; bit 0 stands for "measured and trusted". */
export interface Reason {
    bit: number;
    name: string;
    about: string;
    /** That of pixels for which it decides; undefined where it never does. */
    colour: Uint8Array | undefined;
}

/** What the engine says of itself. */
export interface Facts {
    version: string;
    presets: Preset[];
    reasons: Reason[];
    /** 256 colours each, RGB. */
    scales: Record<Colours, Uint8Array>;
}

/** Disparities in pixels, both ends included. */
export interface Range {
    min: number;
    max: number;
}

export interface Picture {
    width: number;
    height: number;
    /** RGBA. */
    pixels: Uint8ClampedArray<ArrayBuffer>;
}

export interface Pair {
    left: Picture;
    right: Picture;
}

/** A pair that was rectified, with what was done, and the cameras where they are known. */
export interface Rectified extends Pair {
    notes: string[];
    cameras: Cameras | undefined;
}

/** A file of a calibration. */
export interface Text {
    name: string;
    text: string;
}

/** What a calibration says of images that are rectified already, scaled to their size where it is of another one with the same aspect. */
export interface Known {
    /** Labels 0 to ndisp - 1, as the program takes them. */
    range: Range | undefined;
    /** The size of the images that it is of then. */
    size: { width: number; height: number } | undefined;
    cameras: Cameras | undefined;
    /** What is probably wrong with it, and whether it was scaled. */
    notes: string[];
}

/** What is probably wrong, in the program's words, and what the page can do about it. */
export interface Warning {
    text: string;
    remedy: 'swap' | 'rectify' | 'widen' | undefined;
    /** The range to take instead. */
    min?: number;
    max?: number;
}

/** At which size a pair is matched: with `automatic` at half of it where the memory is short. */
export type Size = 'automatic' | 'full' | 'half';

export interface Result {
    width: number;
    height: number;
    range: Range;
    iterations: number;
    device: string;
    /** Why the CPU path stepped in. */
    note: string | undefined;
    warnings: Warning[];
    /** What was corrected in the pair, in words. */
    corrected: string;
    tiles: number;
    /** Whether it was matched at half its size, and whether because the memory is short. */
    half: boolean;
    short: boolean;
    /** The disparities between which nearly all measured pixels are. */
    spread: Range;
    /** Of the match alone, in milliseconds. */
    took: number;
    /** Pixels; +infinity where there is none. */
    disparity: Float32Array<ArrayBuffer>;
    confidence: Uint8Array<ArrayBuffer>;
    validity: Uint8Array<ArrayBuffer>;
    /** Of disparities, in the colours that were asked for. */
    picture: Picture;
}

export interface Comparison {
    device: string;
    note: string | undefined;
    differing: number;
    took: number;
}

/** A rectified pair of pinhole cameras; lengths in pixels, the baseline in its unit. */
export interface Cameras {
    focalLength: number;
    cx: number;
    cy: number;
    doffs: number;
    baseline: number;
    /** mm, cm, m, or unknown. */
    unit: string;
}

export interface Cloud {
    /** x to the right, y down, z forward of the left camera. */
    positions: Float32Array<ArrayBuffer>;
    colours: Uint8Array<ArrayBuffer>;
    confidences: Uint8Array<ArrayBuffer>;
    count: number;
}

/** The calls that the worker takes, with their arguments and answers. */
export interface Calls {
    start(): Facts;
    /** Opens a device; answers with its name for people. */
    open(device: Device): string;
    /** Decodes both images. They stay the worker's pair until the next call. */
    pair(left: Blob, leftName: string, right: Blob, rightName: string): Pair;
    /** The range that sparse matches find. */
    range(): Range | undefined;
    /** What is probably wrong with the pair or with this range. */
    warnings(range: Range | undefined): Warning[];
    /** Matches over a range, which may become wider where sparse matches `found` it. */
    match(device: Device, preset: string, range: Range, found: boolean, size: Size, colours: Colours): Result;
    /** Matches the same pair by another path, and counts the pixels that differ. */
    compare(device: Device): Comparison;
    picture(map: Map, colours: Colours): Picture;
    file(output: Output): Uint8Array<ArrayBuffer>;
    /** Whether these files are a calibration from which no other file is missing. */
    whole(files: Text[]): boolean;
    /** What the files of a calibration say of images of this size; undefined where these are not rectified yet. */
    calibration(files: Text[], width: number, height: number): Known | undefined;
    /** Puts a rectified pair in the place of the pair: by a calibration, or without one by matches. */
    rectify(files: Text[] | undefined): Rectified;
    points(cameras: Cameras): Cloud;
    ply(cameras: Cameras, leastConfidence: number): Uint8Array<ArrayBuffer>;
}

export type Name = keyof Calls;

/** What the page sends. */
export type Request = { cancel: true } | { [N in Name]: { id: number; call: N; args: Parameters<Calls[N]> } }[Name];

/** What the worker sends. */
export type Reply =
    | { id: number; value: ReturnType<Calls[Name]> }
    | { id: number; error: string; why: 'refused' | 'interrupted' }
    | { stage: string; done: number }
    /** The engine cannot go on; the page ends this worker. */
    | { broken: string };
