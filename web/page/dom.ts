// Elements of the page and formatting of values.

import type { Picture } from './protocol';

/** The element with this id in index.html. */
export function by<T extends HTMLElement = HTMLElement>(id: string): T {
    return document.getElementById(id) as T;
}

/** Creates an element. */
export function make<K extends keyof HTMLElementTagNameMap>(
    tag: K,
    properties: Partial<HTMLElementTagNameMap[K]> = {},
    ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
}

/** Sets or clears a text. Live regions are announced only when their text changes. */
export function say(id: string, text: string | undefined): void {
    const all = by(id);
    // A note has a button beside its text.
    const element = all.classList.contains('note') ? (all.querySelector('span') as HTMLElement) : all;
    if (element.textContent !== (text ?? '')) {
        element.textContent = text ?? '';
    }
    if (all !== element) {
        all.hidden = !text;
    }
}

/** Draws a picture on a canvas at its own size. */
export function draw(canvas: HTMLCanvasElement, { width, height, pixels }: Picture): void {
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext('2d');
    if (!context) {
        throw new Error(`The browser cannot show a picture of ${width} × ${height} pixels.`);
    }
    context.putImageData(new ImageData(pixels, width, height), 0, 0);
}

export const words = (error: unknown): string => (error instanceof Error ? error.message : String(error));

/** Capitalizes the first letter. */
export const sentence = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

const whole = new Intl.NumberFormat('en');

/** 76,800 */
export const count = (value: number): string => whole.format(value);

/** 3.4 GiB */
export function size(bytes: number): string {
    const units = ['bytes', 'KiB', 'MiB', 'GiB', 'TiB'];
    const unit = Math.min(units.length - 1, Math.floor(Math.log2(Math.max(1, bytes)) / 10));
    const value = bytes / 2 ** (10 * unit);
    return `${value.toFixed(unit > 0 && value < 10 ? 1 : 0)} ${units[unit]}`;
}

/** 0.42 s, 12 s */
export function duration(milliseconds: number): string {
    const seconds = milliseconds / 1000;
    return `${seconds.toFixed(seconds < 1 ? 2 : seconds < 10 ? 1 : 0)} s`;
}

/** The pixel offset for an arrow key; undefined for other keys. */
export function step(event: KeyboardEvent): [number, number] | undefined {
    const length = event.shiftKey ? 10 : 1;
    const steps: Record<string, [number, number]> = {
        ArrowLeft: [-length, 0],
        ArrowRight: [length, 0],
        ArrowUp: [0, -length],
        ArrowDown: [0, length],
    };
    return steps[event.key];
}
