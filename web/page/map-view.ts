// A zoomable picture with the left image behind a divider, and the selected pixel.

import { by, draw, step } from './dom';
import type { Picture } from './protocol';

const ZOOMS = [1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32];

export interface Pixel {
    x: number;
    y: number;
}

export class MapView {
    private readonly box = by('stage-box');
    private readonly sheet = by('sheet');
    private readonly probe = by('probe');
    private readonly slider = by<HTMLInputElement>('wipe');
    private size = { width: 0, height: 0 };
    /** Undefined fits the picture into its box. */
    private zoom: number | undefined;
    private marked: Pixel | undefined;

    /** `pointed` is called with the pixel under the pointer or undefined, and `picked` with a clicked pixel. */
    constructor(
        private readonly pointed: (pixel: Pixel | undefined) => void,
        private readonly picked: (pixel: Pixel) => void,
    ) {
        new ResizeObserver(() => this.layOut()).observe(this.box);
        this.listenToZoom();
        this.listenToPointer();
        this.listenToWipe();
        this.listenToPinch();
    }

    /** Replaces the picture by another of the same size. */
    redraw(view: Picture): void {
        draw(by<HTMLCanvasElement>('view'), view);
    }

    /** Shows a picture and another of its size behind the divider; a new size resets the zoom. */
    show(view: Picture, behind: Picture): void {
        draw(by<HTMLCanvasElement>('view'), view);
        draw(by<HTMLCanvasElement>('under'), behind);
        by('map').classList.add('shown');
        if (view.width !== this.size.width || view.height !== this.size.height) {
            this.size = { width: view.width, height: view.height };
            this.zoom = undefined;
            this.mark(undefined);
        }
        const same = view === behind;
        by('divider').hidden = by('wipe-label').hidden = by('under').hidden = same;
        this.layOut();
    }

    clear(): void {
        by('map').classList.remove('shown');
        this.size = { width: 0, height: 0 };
        this.mark(undefined);
        for (const id of ['view', 'under']) {
            const canvas = by<HTMLCanvasElement>(id);
            canvas.width = canvas.height = 0;
        }
    }

    private get fit(): number {
        // Uses fractional sizes, and ignores scroll bars, as a fitted picture has none.
        const { width, height } = this.box.getBoundingClientRect();
        return Math.min(width / this.size.width, height / this.size.height);
    }

    private get scale(): number {
        return this.zoom ?? this.fit;
    }

    private layOut(): void {
        const { width, height } = this.size;
        if (width === 0 || this.box.clientWidth === 0) {
            return;
        }
        const scale = this.scale;
        // Rounded down, so that a fitted picture needs no scroll bars.
        this.sheet.style.width = `${Math.floor(width * scale)}px`;
        this.sheet.style.height = `${Math.floor(height * scale)}px`;
        this.sheet.classList.toggle('pixels', scale > 1);
        by('zoom').textContent = `${Math.round(100 * scale)} %`;
        by('zoom-fit').setAttribute('aria-pressed', String(this.zoom === undefined));
        by('zoom-one').setAttribute('aria-pressed', String(this.zoom === 1));
        this.box.dataset['zoom'] = String(this.zoom ?? 'fit');
        this.place();
    }

    /** Zooms around this point of the window. */
    private zoomTo(zoom: number | undefined, at?: { clientX: number; clientY: number }): void {
        const box = this.box.getBoundingClientRect();
        const { clientX, clientY } = at ?? { clientX: box.x + box.width / 2, clientY: box.y + box.height / 2 };
        const before = this.sheet.getBoundingClientRect();
        const [x, y] = [(clientX - before.x) / this.scale, (clientY - before.y) / this.scale];
        this.zoom = zoom;
        this.layOut();
        const after = this.sheet.getBoundingClientRect();
        this.box.scrollBy(after.x + x * this.scale - clientX, after.y + y * this.scale - clientY);
    }

    private zoomBy(direction: 1 | -1, at?: { clientX: number; clientY: number }): void {
        const now = this.scale;
        const next = direction > 0 ? ZOOMS.find((zoom) => zoom > now * 1.001) : ZOOMS.findLast((zoom) => zoom < now * 0.999);
        if (next && this.size.width > 0) {
            this.zoomTo(next, at);
        }
    }

    private listenToZoom(): void {
        by('zoom-in').addEventListener('click', () => this.zoomBy(1));
        by('zoom-out').addEventListener('click', () => this.zoomBy(-1));
        by('zoom-one').addEventListener('click', () => this.zoomTo(1));
        by('zoom-fit').addEventListener('click', () => this.zoomTo(undefined));
        this.box.addEventListener(
            'wheel',
            (event) => {
                if (this.size.width > 0 && event.deltaY !== 0) {
                    event.preventDefault();
                    this.zoomBy(event.deltaY < 0 ? 1 : -1, event);
                }
            },
            { passive: false },
        );
        this.box.addEventListener('keydown', (event) => {
            const moved = step(event);
            if (this.size.width === 0 || event.ctrlKey || event.metaKey || event.altKey) {
                return;
            }
            if (moved) {
                const { x, y } = this.marked ?? { x: this.size.width >> 1, y: this.size.height >> 1 };
                const clamp = (value: number, end: number) => Math.min(Math.max(value, 0), end - 1);
                this.mark({ x: clamp(x + moved[0], this.size.width), y: clamp(y + moved[1], this.size.height) });
                this.probe.scrollIntoView({ block: 'nearest', inline: 'nearest' });
                this.pointed(this.marked);
            } else if (event.key === 'Enter' && this.marked) {
                this.picked(this.marked);
            } else if (event.key === '+' || event.key === '=') {
                this.zoomBy(1);
            } else if (event.key === '-') {
                this.zoomBy(-1);
            } else if (event.key === '0') {
                this.zoomTo(undefined);
            } else if (event.key === '1') {
                this.zoomTo(1);
            } else {
                return;
            }
            event.preventDefault();
        });
    }

    /** Marks the pixel that arrow keys move. */
    private mark(pixel: Pixel | undefined): void {
        this.marked = pixel;
        this.probe.hidden = !pixel;
        this.place();
    }

    private place(): void {
        if (this.marked) {
            this.probe.style.left = `${(this.marked.x + 0.5) * this.scale}px`;
            this.probe.style.top = `${(this.marked.y + 0.5) * this.scale}px`;
        }
    }

    private listenToPointer(): void {
        const pixel = ({ clientX, clientY }: MouseEvent): Pixel | undefined => {
            const sheet = this.sheet.getBoundingClientRect();
            const [x, y] = [clientX - sheet.x, clientY - sheet.y].map((v) => Math.floor(v / this.scale)) as [number, number];
            return x >= 0 && y >= 0 && x < this.size.width && y < this.size.height ? { x, y } : undefined;
        };
        this.box.addEventListener('pointermove', (event) => {
            if (this.box.hasPointerCapture(event.pointerId)) {
                this.box.scrollBy(-event.movementX, -event.movementY);
            }
            this.mark(undefined);
            this.pointed(pixel(event));
        });
        this.box.addEventListener('pointerleave', () => {
            if (!this.marked) {
                this.pointed(undefined);
            }
        });
        let pressed = { x: 0, y: 0 };
        this.box.addEventListener('click', (event) => {
            const at = pixel(event);
            // Ignores clicks that end a drag.
            if (at && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < 4) {
                this.picked(at);
            }
        });
        this.box.addEventListener('pointerdown', (event) => {
            pressed = { x: event.clientX, y: event.clientY };
            // Touch scrolls natively.
            if (event.button === 0 && event.pointerType === 'mouse' && this.zoom !== undefined) {
                this.box.setPointerCapture(event.pointerId);
            }
            this.pointed(pixel(event));
        });
    }

    /** Pinching zooms the picture instead of the page. */
    private listenToPinch(): void {
        let start: { apart: number; zoom: number } | undefined;
        const fingers = ({ touches }: TouchEvent) => {
            const [a, b] = [touches[0], touches[1]];
            return touches.length === 2 && a && b && this.size.width > 0
                ? { apart: Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), clientX: (a.clientX + b.clientX) / 2, clientY: (a.clientY + b.clientY) / 2 }
                : undefined;
        };
        this.box.addEventListener('touchstart', (event) => {
            const at = fingers(event);
            start = at && { apart: at.apart, zoom: this.scale };
        }, { passive: true });
        this.box.addEventListener('touchmove', (event) => {
            const at = fingers(event);
            if (at && start) {
                event.preventDefault();
                const [least, most] = [ZOOMS[0] ?? 1, ZOOMS.at(-1) ?? 1];
                this.zoomTo(Math.min(Math.max((start.zoom * at.apart) / Math.max(1, start.apart), least), most), at);
            }
        }, { passive: false });
    }

    private listenToWipe(): void {
        const divider = by('divider');
        const wipe = (percent: number) => {
            this.slider.value = String(percent);
            this.sheet.style.setProperty('--wipe', `${this.slider.value}%`);
        };
        this.slider.addEventListener('input', () => wipe(this.slider.valueAsNumber));
        divider.addEventListener('pointerdown', (event) => {
            event.stopPropagation();
            event.preventDefault();
            divider.setPointerCapture(event.pointerId);
        });
        divider.addEventListener('pointermove', (event) => {
            if (divider.hasPointerCapture(event.pointerId)) {
                event.stopPropagation();
                const { x, width } = this.sheet.getBoundingClientRect();
                wipe((100 * (event.clientX - x)) / width);
            }
        });
        // Shows the photo and the map at once, and that the divider moves.
        wipe(50);
    }
}
