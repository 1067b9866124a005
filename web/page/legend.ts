// The legend of a view.

import { by, make } from './dom';
import type { Reason } from './protocol';

/** The colour scale below the picture, from the least to the largest value. */
export function scale(colours: Uint8Array, min: string, max: string, unit: string, about = ''): void {
    const canvas = by('scale').querySelector('canvas') as HTMLCanvasElement;
    const pixels = new ImageData(256, 1);
    for (let i = 0; i < 256; i += 1) {
        pixels.data.set([...colours.subarray(3 * i, 3 * i + 3), 255], 4 * i);
    }
    canvas.getContext('2d')?.putImageData(pixels, 0, 0);
    by('scale-min').textContent = min;
    by('scale-max').textContent = max;
    by('scale-unit').textContent = unit;
    by('scale').title = about;
    by('scale').hidden = false;
    by('legend').hidden = true;
}

/** The reasons of a pixel of the validity map. */
export function named(reasons: Reason[], validity: number): Reason[] {
    return reasons.filter(({ bit }) => (bit === 0 ? validity === 0 : (validity & bit) !== 0));
}

/** Lists the reasons with their colours and shares of pixels; a pixel may have several. */
export function reasons(all: Reason[], validity: Uint8Array): void {
    const pixels = new Uint32Array(256);
    for (const value of validity) {
        pixels[value] = (pixels[value] ?? 0) + 1;
    }
    const share = ({ bit }: Reason) => {
        const of = pixels.reduce((sum, n, value) => sum + (named(all, value).some((r) => r.bit === bit) ? n : 0), 0);
        return `${((100 * of) / validity.length).toFixed(1)} %`;
    };
    by('legend').replaceChildren(
        ...all.map((reason) => {
            const swatch = make('i');
            if (reason.colour) {
                swatch.style.background = `rgb(${reason.colour.join(' ')})`;
            }
            swatch.hidden = !reason.colour;
            return make('li', { title: reason.about }, swatch, `${reason.name} `, make('span', {}, share(reason)));
        }),
    );
    by('legend').hidden = false;
    by('scale').hidden = true;
}

export function none(): void {
    by('legend').hidden = by('scale').hidden = true;
}
