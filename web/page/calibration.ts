// What the page itself takes from a calib.txt; the engine reads the cameras.

import type { Range } from './protocol';

export interface Calibration {
    text: string;
    /** Labels 0 to ndisp - 1, as the program takes them. */
    range: Range | undefined;
    size: { width: number; height: number } | undefined;
    /** Whether it tells of the cameras; some files have the range alone. */
    cameras: boolean;
}

export function calibration(text: string): Calibration {
    const number = (key: string) => {
        const value = text.match(new RegExp(`^\\s*${key}\\s*=\\s*(\\d+)\\s*$`, 'm'))?.[1];
        return value === undefined ? undefined : Number(value);
    };
    const [labels, width, height] = [number('ndisp'), number('width'), number('height')];
    return {
        text,
        range: labels ? { min: 0, max: labels - 1 } : undefined,
        size: width && height ? { width, height } : undefined,
        cameras: /^\s*cam0\s*=/m.test(text) || !labels,
    };
}
