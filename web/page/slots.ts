// The two views and how they come in: dropped, pasted, chosen, or from a rendered scene.

import { type Calibration, calibration } from './calibration';
import { by, count, make, say, words } from './dom';
import { type Header, header } from './header';
import { swapped } from './order';
import type { Picture } from './protocol';

export type Side = 'left' | 'right';

export interface View {
    file: Blob;
    name: string;
    header: Header;
}

/** A rendered scene of the project, as the build finds it. */
export interface Scene {
    name: string;
    title: string;
}

const other = (side: Side): Side => (side === 'left' ? 'right' : 'left');
const READS = 'PNG, JPEG, PNM, TIFF or PFM';

interface Named {
    file: Blob;
    name: string;
}

export class Slots {
    views: Partial<Record<Side, View>> = {};
    calibration: Calibration | undefined;
    /** The scene that the views are of. */
    scene: string | undefined;
    /** Grows with every change, so that a slow answer to an earlier one is recognised. */
    private turn = 0;

    /** `changed` is called after every change of a view or of the calibration. */
    constructor(scenes: Scene[], private readonly changed: () => void) {
        for (const side of ['left', 'right'] as const) {
            const input = by<HTMLInputElement>(`${side}-file`);
            input.addEventListener('change', () => {
                const files = [...(input.files ?? [])];
                // The same file can be chosen again.
                input.value = '';
                void this.take(files, side);
            });
        }
        by('swap').addEventListener('click', () => this.swap());
        by('scenes').append(...scenes.map((scene) => this.button(scene)));
        this.listen();
    }

    /** Files from anywhere: one for a slot, or two that are told apart by their names. */
    async take(files: (File | Named)[], side?: Side): Promise<void> {
        const turn = ++this.turn;
        const named = files.map((file) => ('file' in file ? file : { file, name: file.name || 'pasted image' }));
        const texts = named.filter(({ name }) => /\.txt$/i.test(name));
        const images = named.filter((file) => !texts.includes(file));
        if (named.length === 0) {
            return;
        }
        if (images.length > 2 || texts.length > 1) {
            say('pair-problem', `These are ${count(named.length)} files. Take two views, and a calib.txt if you have one.`);
            return;
        }
        say('pair-problem', undefined);
        this.scene = undefined;
        if (texts[0]) {
            this.calibration = calibration(await texts[0].file.text());
        } else if (images.length === 2) {
            // That of another pair.
            this.calibration = undefined;
        }
        if (images.length === 2) {
            images.sort((a, b) => (swapped(a.name, b.name) ? 1 : -1));
            this.views = {};
            await Promise.all([this.fill('left', images[0] as Named), this.fill('right', images[1] as Named)]);
        } else if (images[0]) {
            await this.fill(side ?? (this.views.left && !this.views.right ? 'right' : 'left'), images[0]);
        }
        // Not where a later choice has overtaken this one.
        if (turn === this.turn) {
            this.press();
            this.changed();
        }
    }

    /** What is wrong with a view, at its slot. */
    problem(side: Side, text: string | undefined): void {
        say(`${side}-problem`, text);
        by<HTMLInputElement>(`${side}-file`).setAttribute('aria-invalid', String(Boolean(text)));
    }

    /** The engine's picture of a view, which also shows what the browser cannot decode. */
    show(side: Side, picture: Picture): void {
        const whole = new OffscreenCanvas(picture.width, picture.height);
        whole.getContext('2d')?.putImageData(new ImageData(picture.pixels, picture.width, picture.height), 0, 0);
        this.thumb(side, whole);
    }

    private async fill(side: Side, { file, name }: Named): Promise<void> {
        delete this.views[side];
        this.label(side, name);
        try {
            const found = await header(file);
            if (!found) {
                throw new Error(`${name} is not an image that the engine reads: ${READS}.`);
            }
            this.problem(side, undefined);
            this.views[side] = { file, name, header: found };
        } catch (error) {
            this.problem(side, words(error));
        }
        if (this.views[side]) {
            const bitmap = await createImageBitmap(file).catch(() => undefined);
            this.thumb(side, bitmap);
            bitmap?.close();
        }
    }

    private label(side: Side, name: string): void {
        const label = by(side).querySelector('.name') as HTMLElement;
        label.textContent = name;
        label.title = name;
        by(side).classList.toggle('filled', true);
        this.thumb(side, undefined);
    }

    private thumb(side: Side, image: (CanvasImageSource & { width: number; height: number }) | undefined): void {
        const canvas = by(side).querySelector('canvas') as HTMLCanvasElement;
        canvas.hidden = !image;
        if (image) {
            const scale = Math.min(1, 320 / Math.max(image.width, image.height));
            [canvas.width, canvas.height] = [image.width, image.height].map((s) => Math.max(1, Math.round(s * scale))) as [number, number];
            const context = canvas.getContext('2d');
            if (context) {
                context.imageSmoothingQuality = 'high';
                context.drawImage(image, 0, 0, canvas.width, canvas.height);
            }
        }
    }

    private swap(): void {
        this.turn += 1;
        const { left, right } = this.views;
        this.views = { ...(right && { left: right }), ...(left && { right: left }) };
        const [a, b] = [by('left'), by('right')];
        const [first, second] = [a, b].map((slot) => slot.querySelector('label') as HTMLElement) as [HTMLElement, HTMLElement];
        // The labels change places, but for the word that says which view it is.
        for (const part of ['.thumb', '.name']) {
            const [one, two] = [first.querySelector(part) as HTMLElement, second.querySelector(part) as HTMLElement];
            const place = document.createComment('');
            one.replaceWith(place);
            two.replaceWith(one);
            place.replaceWith(two);
        }
        const [filled, other] = [a.classList.contains('filled'), b.classList.contains('filled')];
        a.classList.toggle('filled', other);
        b.classList.toggle('filled', filled);
        const [one, two] = (['left', 'right'] as const).map((side) => by(`${side}-problem`).textContent ?? '');
        this.problem('left', two);
        this.problem('right', one);
        say('pair-problem', undefined);
        this.changed();
    }

    private button({ name, title }: Scene): HTMLButtonElement {
        const picture = make('img', { src: `scenes/${name}/small.png`, alt: '', width: 120, height: 90 });
        const button = make('button', { type: 'button' }, picture, title);
        button.dataset['scene'] = name;
        button.setAttribute('aria-pressed', 'false');
        button.addEventListener('click', () => void this.open(name));
        return button;
    }

    private async open(name: string): Promise<void> {
        const turn = ++this.turn;
        const get = async (file: string) => {
            const answer = await fetch(`scenes/${name}/${file}`);
            if (!answer.ok) {
                throw new Error(`${answer.status} ${answer.statusText}`);
            }
            return { file: await answer.blob(), name: `${name} ${file}` };
        };
        try {
            const files = await Promise.all([get('im0.png'), get('im1.png'), get('calib.txt')]);
            if (turn !== this.turn) {
                return;
            }
            const taken = this.take(files);
            this.scene = name;
            await taken;
        } catch (error) {
            say('pair-problem', `The scene could not be loaded (${words(error)}). Offline, only scenes that were opened before are at hand.`);
        }
    }

    private press(): void {
        for (const button of by('scenes').querySelectorAll('button')) {
            button.setAttribute('aria-pressed', String(button.dataset['scene'] === this.scene));
        }
    }

    private listen(): void {
        const drop = by('drop');
        const files = (event: DragEvent) => event.dataTransfer?.types.includes('Files') ?? false;
        document.addEventListener('dragover', (event) => {
            if (files(event)) {
                event.preventDefault();
                drop.hidden = false;
            }
        });
        document.addEventListener('dragleave', (event) => {
            drop.hidden ||= event.relatedTarget === null;
        });
        document.addEventListener('drop', (event) => {
            drop.hidden = true;
            if (files(event)) {
                event.preventDefault();
                const slot = (event.target as Element | null)?.closest?.('.slot')?.id as Side | undefined;
                void this.take([...(event.dataTransfer?.files ?? [])], slot);
            }
        });
        document.addEventListener('paste', (event) => {
            const slot = document.activeElement?.closest('.slot')?.id as Side | undefined;
            void this.take([...(event.clipboardData?.files ?? [])], slot);
        });
    }

    /** The first view that is missing. */
    get missing(): Side | undefined {
        return (['left', 'right'] as const).find((side) => !this.views[side]);
    }

    /** Says at the empty slot that its view is missing. */
    askFor(side: Side): void {
        if (!by(`${side}-problem`).textContent) {
            const has = this.views[other(side)] ? ' too' : '';
            this.problem(side, `Choose the ${side} view${has}.`);
        }
        by(`${side}-file`).focus();
    }
}
