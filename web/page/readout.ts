// The readout of a pixel in one line.

import { named } from './legend';
import type { Pixel } from './map-view';
import type { Cameras, Facts, Result } from './protocol';
import { inUnit, place } from './ruler';

/** The readout of a pixel; includes the depth if the cameras are known. */
export function told(pixel: Pixel, result: Result, facts: Facts, cameras: Cameras | undefined): string {
    const at = pixel.y * result.width + pixel.x;
    const [disparity, confidence, validity] = [result.disparity[at] ?? Infinity, result.confidence[at] ?? 0, result.validity[at] ?? 0];
    const parts = [
        `x ${pixel.x}, y ${pixel.y}`,
        Number.isFinite(disparity) ? `disparity ${disparity.toFixed(2)} px` : 'no disparity',
        `confidence ${confidence}`,
        named(facts.reasons, validity).map(({ name }) => name).join(', '),
    ];
    const at3 = cameras && place(pixel, disparity, cameras);
    if (at3) {
        parts.push(`depth ${inUnit(at3[2], cameras.unit)}`);
    }
    return parts.join(' · ');
}
