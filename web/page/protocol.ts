// Messages between page and worker. Each call has one reply; progress messages may precede it.

export type Device = 'gpu' | 'cpu';
export type Colours = 'turbo' | 'viridis' | 'grey';
/** The maps shown as pictures. */
export type Map = 'disparity' | 'confidence' | 'validity';
/** The maps that can be saved, named as in `mrfgs match --also`, and the disparities in both formats. */
export type Output = 'pfm' | 'raw' | 'png' | 'confidence' | 'validity';

export interface Preset {
    name: string;
    about: string;
}

/** One bit of the validity map; bit 0 stands for "measured and reliable". */
export interface Reason {
    bit: number;
    name: string;
    about: string;
    /** Colour of pixels for which this reason decides; undefined if it never does. */
    colour: Uint8Array | undefined;
}

/** Properties of the engine. */
export interface Facts {
    version: string;
    presets: Preset[];
    reasons: Reason[];
    /** 256 RGB colours each. */
    scales: Record<Colours, Uint8Array>;
}

/** Disparities in pixels, inclusive. */
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

/** A rectified pair with notes, and the cameras if known. */
export interface Rectified extends Pair {
    notes: string[];
    cameras: Cameras | undefined;
}

/** A calibration file. */
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

/** What is known of the left view. */
export interface Prior {
    kind: 'points' | 'surface';
    /** Number of pixels for which a disparity was given. */
    given: number;
}

/** How much of it was used. */
export interface PriorUse extends Prior {
    /** Number of these that their neighbours contradict. */
    dropped: number;
    trust: number;
}

/** A likely problem, and the remedy that the page can apply. */
export interface Warning {
    text: string;
    remedy: 'swap' | 'rectify' | 'widen' | undefined;
    /** The range to use instead. */
    min?: number;
    max?: number;
}

/** Size at which a pair is matched; `automatic` halves it if the memory is insufficient. */
export type Size = 'automatic' | 'full' | 'half';

export interface Result {
    width: number;
    height: number;
    range: Range;
    iterations: number;
    device: string;
    /** Why the CPU was used instead of the GPU. */
    note: string | undefined;
    warnings: Warning[];
    /** The corrections made to the pair, in words. */
    corrected: string;
    /** How much of what was known was used. */
    prior: PriorUse | undefined;
    tiles: number;
    /** Whether it was matched at half size, and whether for lack of memory. */
    half: boolean;
    short: boolean;
    /** The range of nearly all measured disparities. */
    spread: Range;
    /** Duration of the match alone, in ms. */
    took: number;
    /** In pixels; +Infinity where missing. */
    disparity: Float32Array<ArrayBuffer>;
    confidence: Uint8Array<ArrayBuffer>;
    validity: Uint8Array<ArrayBuffer>;
    /** The disparities in the requested colours. */
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
    /** mm, cm, m or unknown. */
    unit: string;
}

/** A frame of a video, matched. */
export interface Live {
    range: Range;
    /** In pixels; +Infinity where missing. */
    disparity: Float32Array<ArrayBuffer>;
    /** The disparities in colours over the range. */
    picture: Picture;
    /** The left view, if it was rectified. */
    left: Picture | undefined;
}

/** The calls of the worker, with arguments and results. */
export interface Calls {
    start(): Facts;
    /** Opens a device and returns its display name. */
    open(device: Device): string;
    /** Decodes both images and makes them the worker's pair. */
    pair(left: Blob, leftName: string, right: Blob, rightName: string): Pair;
    /** Takes what a file knows of the left view of the pair. */
    know(file: Blob, name: string): Prior;
    /** The range found by sparse matching. */
    range(): Range | undefined;
    /** Likely problems of the pair or of this range. */
    warnings(range: Range | undefined): Warning[];
    /** Matches over a range, which may be widened if sparse matching `found` it. */
    match(device: Device, preset: string, range: Range, found: boolean, size: Size, colours: Colours): Result;
    /** Matches the same pair on another device, and counts the pixels that differ. */
    compare(device: Device): Comparison;
    picture(map: Map, colours: Colours): Picture;
    file(output: Output): Uint8Array<ArrayBuffer>;
    /** Whether these files are a calibration from which no other file is missing. */
    whole(files: Text[]): boolean;
    /** What the files of a calibration say of images of this size; undefined where these are not rectified yet. */
    calibration(files: Text[], width: number, height: number): Known | undefined;
    /** Puts a rectified pair in the place of the pair: by a calibration, or without one by matches. */
    rectify(files: Text[] | undefined): Rectified;
    ply(cameras: Cameras, leastConfidence: number): Uint8Array<ArrayBuffer>;
    /** Begins a video on a device, and returns the display name of it. */
    video(device: Device): string;
    /** Learns from a frame how the views are rectified and which disparities there are, and returns what was done. Takes the images over. */
    learn(left: ImageBitmap, right: ImageBitmap): string[];
    /** Matches a frame. Takes the images over. */
    frame(left: ImageBitmap, right: ImageBitmap): Live;
    endVideo(): void;
}

export type Name = keyof Calls;

/** Messages of the page. */
export type Request = { cancel: true } | { [N in Name]: { id: number; call: N; args: Parameters<Calls[N]> } }[Name];

/** Messages of the worker. */
export type Reply =
    | { id: number; value: ReturnType<Calls[Name]> }
    | { id: number; error: string; why: 'refused' | 'interrupted' }
    | { stage: string; done: number }
    /** The engine has crashed; the page replaces this worker. */
    | { broken: string };
