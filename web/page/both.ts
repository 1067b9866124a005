// Both views in one file of a 3-D camera: MPO, two JPEG images in sequence, and JPS, one image with both.

import type { Cut } from './decode';

/** Where the views of an image with both are. */
export interface Halves {
    how: Cut;
    /** Whether the left view is the left or the upper half. */
    leftFirst: boolean;
}

/** How far from the start of a file its views may be described. */
const REACH = 1 << 20;
/** The tag of the list of images. */
const IMAGES = 0xb002;
/** The kind of images that are reduced copies of others. */
const COPIES = 1;

/** The two views in a file, or how to split it; undefined if the file does not say that it holds both. */
export async function both(file: Blob, name: string): Promise<[Blob, Blob] | Halves | undefined> {
    const view = new DataView(await file.slice(0, REACH).arrayBuffer());
    if (view.byteLength < 2 || view.getUint16(0) !== 0xffd8) {
        return undefined;
    }
    try {
        for (const { marker, start, end } of segments(view)) {
            const starts = (text: string) => [...text].every((letter, i) => start + i < end && view.getUint8(start + i) === letter.charCodeAt(0));
            if (marker === 0xe2 && starts('MPF\0')) {
                return images(file, new DataView(view.buffer, start + 4, end - start - 4), start + 4);
            }
            if (marker === 0xe3 && starts('_JPSJPS_')) {
                // After the signature and two bytes: separation of the views, flags, layout, and the kind of file.
                const [flags, layout, kind] = [view.getUint8(start + 11), view.getUint8(start + 12), view.getUint8(start + 13)];
                const leftFirst = (flags & 4) !== 0;
                return kind === 1 && (layout === 2 || layout === 3) ? { how: layout === 3 ? 'above' : 'beside', leftFirst } : undefined;
            }
        }
    } catch {
        // The description is cut off, so the file counts as one view.
        return undefined;
    }
    // These are for cross-eyed viewing.
    return /\.jps$/i.test(name) ? { how: 'beside', leftFirst: false } : undefined;
}

/** The segments of a JPEG file before its pixels. */
function* segments(view: DataView): Generator<{ marker: number; start: number; end: number }> {
    let at = 2;
    while (at + 4 <= view.byteLength && view.getUint8(at) === 0xff) {
        const [marker, length] = [view.getUint8(at + 1), view.getUint16(at + 2)];
        if (marker === 0xda || length < 2) {
            return;
        }
        yield { marker, start: at + 4, end: Math.min(at + 2 + length, view.byteLength) };
        at += 2 + length;
    }
}

/** The views in an MPO file with this list of images, which starts at `origin`; undefined if there are not two. */
function images(file: Blob, list: DataView, origin: number): [Blob, Blob] | undefined {
    const little = list.getUint8(0) === 0x49;
    const directory = list.getUint32(4, little);
    const entries = Array.from({ length: list.getUint16(directory, little) }, (_, i) => directory + 2 + 12 * i);
    const entry = entries.find((at) => list.getUint16(at, little) === IMAGES);
    if (entry === undefined) {
        return undefined;
    }
    const [length, start] = [list.getUint32(entry + 4, little), list.getUint32(entry + 8, little)];
    const all = Array.from({ length: Math.floor(length / 16) }, (_, i) => {
        const at = start + 16 * i;
        const [kind, size, offset] = [list.getUint32(at, little), list.getUint32(at + 4, little), list.getUint32(at + 8, little)];
        // The first image starts the file; the other offsets count from here.
        const first = offset === 0 ? 0 : origin + offset;
        return { kind: (kind >> 16) & 0xff, first, end: first + size };
    });
    const [left, right, ...more] = all.filter(({ kind }) => kind !== COPIES);
    if (!left || !right || more.length > 0 || right.end > file.size) {
        return undefined;
    }
    return [file.slice(left.first, left.end, 'image/jpeg'), file.slice(right.first, right.end, 'image/jpeg')];
}
