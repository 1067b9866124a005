// A picture of the map that is shown, with its legend, to share or to save.

import { by } from './dom';
import { share } from './save';

/** The share of the width that a line of the legend is high, and its limits in pixels. */
const LINE = { share: 0.05, least: 16, most: 64 };

/** Shares or saves the picture. */
export async function sharePicture(name: string): Promise<void> {
    const blob = await drawn().convertToBlob({ type: 'image/png' });
    await share(new File([blob], `${name}-picture.png`, { type: blob.type }));
}

/** The map as it is shown, without its divider, above the colours of its scale. */
function drawn(): OffscreenCanvas {
    const map = by<HTMLCanvasElement>('view');
    const scale = by('scale');
    const line = scale.hidden ? 0 : Math.round(Math.min(Math.max(LINE.share * map.width, LINE.least), LINE.most));
    const canvas = new OffscreenCanvas(map.width, map.height + line);
    const context = canvas.getContext('2d');
    const colours = scale.querySelector('canvas');
    if (!context) {
        throw new Error('This browser cannot draw the picture.');
    }
    context.drawImage(map, 0, 0);
    if (line > 0 && colours) {
        context.fillStyle = 'white';
        context.fillRect(0, map.height, map.width, line);
        const [least, most, unit] = ['scale-min', 'scale-max', 'scale-unit'].map((id) => by(id).textContent ?? '') as [string, string, string];
        context.font = `${Math.round(0.6 * line)}px sans-serif`;
        context.textBaseline = 'middle';
        context.fillStyle = 'black';
        const [gap, middle] = [0.3 * line, map.height + line / 2];
        const end = `${most} ${unit}`;
        const [start, stop] = [2 * gap + context.measureText(least).width, map.width - 2 * gap - context.measureText(end).width];
        context.fillText(least, gap, middle);
        context.fillText(end, stop + gap, middle);
        context.drawImage(colours, start, map.height + gap, Math.max(0, stop - start), line - 2 * gap);
    }
    return canvas;
}
