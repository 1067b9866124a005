// Measures the distance of two points in the scene.

import { by, say } from './dom';
import type { Pixel } from './map-view';
import type { Cameras } from './protocol';

/** The 3-D point of a pixel (x right, y down, z forward of the left camera); undefined if it has no finite depth. */
export function place({ x, y }: Pixel, disparity: number, { focalLength, cx, cy, doffs, baseline }: Cameras): [number, number, number] | undefined {
    const z = (focalLength * baseline) / (disparity + doffs);
    return z > 0 && Number.isFinite(z) ? [((x - cx) * z) / focalLength, ((y - cy) * z) / focalLength, z] : undefined;
}

/** Formats a length in this unit. */
export const inUnit = (length: number, unit: string): string =>
    `${length.toPrecision(5)} ${unit === 'unknown' ? 'in the unit of the baseline' : unit}`;

export class Ruler {
    private ends: Pixel[] = [];

    /** `disparity` returns that of a pixel, infinite if missing; `cameras` the known ones, and `size` that of the map. */
    constructor(
        private readonly disparity: (pixel: Pixel) => number,
        private readonly cameras: () => Cameras | undefined,
        private readonly size: () => { width: number; height: number } | undefined,
    ) {
        by('measure').addEventListener('click', () => {
            by('measure').setAttribute('aria-pressed', String(!this.on));
            this.clear();
        });
    }

    get on(): boolean {
        return by('measure').getAttribute('aria-pressed') === 'true';
    }

    /** Sets an end; the third pick starts over. */
    pick(pixel: Pixel): void {
        if (this.on) {
            this.ends = [...(this.ends.length < 2 ? this.ends : []), pixel];
            this.draw();
        }
    }

    /** Resets the ruler for another map. */
    clear(): void {
        this.ends = [];
        this.draw();
    }

    /** Shows the measurement with the current cameras. */
    draw(): void {
        const { width, height } = this.size() ?? { width: 1, height: 1 };
        const [a, b] = this.ends;
        const svg = by('ruler');
        svg.toggleAttribute('hidden', !a);
        svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
        const [from, to] = [a ?? { x: 0, y: 0 }, b ?? a ?? { x: 0, y: 0 }];
        const line = `M${from.x + 0.5} ${from.y + 0.5}L${to.x + 0.5} ${to.y + 0.5}`;
        for (const path of svg.querySelectorAll('path')) {
            path.setAttribute('d', line);
        }
        say('distance', this.on && this.size() ? this.words : undefined);
    }

    private get words(): string {
        const [a, b] = this.ends;
        if (!a || !b) {
            return a ? 'Now click on the other end.' : 'Click on one end, and then on the other; by keyboard, arrows and Enter.';
        }
        const cameras = this.cameras();
        if (!cameras) {
            return 'No length: the cameras are a guess. Give them in the tab Surface, or drop a calibration.';
        }
        const [from, to] = [a, b].map((end) => place(end, this.disparity(end), cameras));
        if (!from || !to) {
            return `No length: the ${from ? 'second' : 'first'} end has no depth.`;
        }
        const apart = Math.hypot(...from.map((value, i) => value - (to[i] ?? 0)));
        return `${inUnit(apart, cameras.unit)} apart`;
    }
}
