// Decoding by the browser of formats that the engine does not read, and splitting of images that hold both views.

import { inOrder } from './order';

/** How to split an image into two views. */
export type Cut = 'beside' | 'above';

/** Longer side of the thumbnails of the halves to compare. */
const SMALL = 48;

/** Correlation from which the halves of an image of a plausible shape count as two views. */
const ALIKE = 0.6;

/** Correlation from which an upper and a lower half count as two views in any shape. Those of 50 single photographs reach 0.84. */
const SURE = 0.9;

function canvas(width: number, height: number): { canvas: OffscreenCanvas; context: OffscreenCanvasRenderingContext2D } {
    const canvas = new OffscreenCanvas(width, height);
    const context = canvas.getContext('2d', { willReadFrequently: true });
    if (!context) {
        throw new Error(`The browser cannot hold a picture of ${width} × ${height} pixels.`);
    }
    return { canvas, context };
}

/** Converts a file to upright PNG with the browser; undefined if the browser cannot read it either. */
export async function decoded(file: Blob): Promise<Blob | undefined> {
    const bitmap = await createImageBitmap(file, { imageOrientation: 'from-image' }).catch(() => undefined);
    return bitmap && part(bitmap, 0, 0, bitmap.width, bitmap.height).finally(() => bitmap.close());
}

function part(image: ImageBitmap, x: number, y: number, width: number, height: number): Promise<Blob> {
    const of = canvas(width, height);
    of.context.drawImage(image, -x, -y);
    return of.canvas.convertToBlob({ type: 'image/png' });
}

/** Splits an image into both views: the left one is on the left or on top. */
export async function cut(file: Blob, how: Cut): Promise<[Blob, Blob]> {
    const image = await createImageBitmap(file);
    try {
        const { width, height } = image;
        const [w, h] = how === 'beside' ? [width >> 1, height] : [width, height >> 1];
        if (w < 1 || h < 1) {
            throw new Error('The image is too small to hold two views.');
        }
        // The middle column or row of an odd number belongs to neither view.
        return await Promise.all([part(image, 0, 0, w, h), part(image, width - w, height - h, w, h)]);
    } finally {
        image.close();
    }
}

/** Guesses how to split an image or a frame that probably holds both views; undefined for a single view. */
export async function guess(file: Blob | HTMLVideoElement): Promise<Cut | undefined> {
    const image = await createImageBitmap(file).catch(() => undefined);
    if (!image) {
        return undefined;
    }
    const grey = (x: number, y: number, width: number, height: number) => {
        const scale = SMALL / Math.max(width, height);
        const [w, h] = [width, height].map((side) => Math.max(1, Math.round(side * scale))) as [number, number];
        const { context } = canvas(w, h);
        context.imageSmoothingQuality = 'high';
        context.drawImage(image, x, y, width, height, 0, 0, w, h);
        const { data } = context.getImageData(0, 0, w, h);
        const at = (i: number) => (data[4 * i] ?? 0) + (data[4 * i + 1] ?? 0) + (data[4 * i + 2] ?? 0);
        return Array.from({ length: h }, (_, y) => Array.from({ length: w }, (_, x) => at(y * w + x)));
    };
    const { width, height } = image;
    const beside = correlation(grey(0, 0, width / 2, height), grey(width / 2, 0, width / 2, height));
    const above = correlation(grey(0, 0, width, height / 2), grey(0, height / 2, width, height / 2));
    image.close();
    // Most single photographs are 4 : 3 to 16 : 9; most stereo images are wider than that, or portrait.
    if (beside > ALIKE && beside > above && width > 1.9 * height) {
        return 'beside';
    }
    return above > beside && (above > SURE || (above > ALIKE && height > 1.05 * width)) ? 'above' : undefined;
}

/** The best correlation of two thumbnails over horizontal shifts of the second. */
function correlation(left: number[][], right: number[][]): number {
    const width = left[0]?.length ?? 0;
    const reach = Math.floor(width / 6);
    const moved = (by: number) => {
        const [from, to] = [Math.max(0, by), Math.min(width, width + by)];
        const [a, b] = [left.flatMap((row) => row.slice(from, to)), right.flatMap((row) => row.slice(from - by, to - by))];
        const mean = (v: number[]) => v.reduce((sum, value) => sum + value, 0) / v.length;
        const [ma, mb] = [mean(a), mean(b)];
        let [ab, aa, bb] = [0, 0, 0];
        a.forEach((value, i) => {
            const [da, db] = [value - ma, (b[i] ?? mb) - mb];
            ab += da * db;
            aa += da * da;
            bb += db * db;
        });
        return aa > 0 && bb > 0 ? ab / Math.sqrt(aa * bb) : 0;
    };
    return Math.max(...Array.from({ length: 2 * reach + 1 }, (_, i) => moved(i - reach)));
}

/** File names of left and right views in benchmarks. */
const LAYOUTS = [
    ['im0', 'im1'],
    ['view1', 'view5'],
    ['im2', 'im6'],
] as const;

const stem = (name: string) => name.replace(/^.*[\\/]/, '').replace(/\.[^.]*$/, '').toLowerCase();

/** Selects the two views among some images, left one first; returns all of them if the names do not tell. */
export function views<T extends { name: string }>(images: T[]): T[] {
    if (images.length > 2) {
        for (const layout of LAYOUTS) {
            const held = layout.map((name) => images.find((image) => stem(image.name) === name));
            if (held[0] && held[1]) {
                return [held[0], held[1]];
            }
        }
    }
    const [one, other] = images;
    return one && other && images.length === 2 ? inOrder(one, other) : images;
}
