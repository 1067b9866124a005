// The two views and how they come in: dropped, pasted, chosen, or from a rendered scene.

import { type Cut, cut, decoded, guess, views } from './decode';
import { by, count, make, say, words } from './dom';
import { type Named, dropped, named } from './dropped';
import { type Header, header } from './header';
import type { Picture, Text } from './protocol';

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
const READS = 'PNG, JPEG, WebP, AVIF, GIF, PNM, TIFF or PFM';
/** Files that hold a calibration, or a list that is not for us. */
const TEXT = /\.(txt|ya?ml|json|xml|ini|conf|cfg|calib|toml)$/i;
/** What a folder of a benchmark holds beside the views. */
const OTHER = /^(disp|mask|readme|license|\.)|GT\b|\.(pfm|py|md)$/i;

export class Slots {
    views: Partial<Record<Side, View>> = {};
    calibration: Text[] = [];
    /** The scene that the views are of. */
    scene: string | undefined;
    /** What the pair is called, where that is more than the names of its files. */
    name: string | undefined;
    /** The image that came last, alone. */
    private last: View | undefined;
    /** Whether the calibration came before its pair. */
    private waiting = false;
    /** Grows with every change, so that a slow answer to an earlier one is recognised. */
    private turn = 0;

    /** `changed` is called after every change of a view or of the calibration, and told whether the pair is to be matched at once. */
    constructor(scenes: Scene[], private readonly changed: (match: boolean) => void) {
        for (const side of ['left', 'right'] as const) {
            const input = by<HTMLInputElement>(`${side}-file`);
            input.addEventListener('change', () => {
                void this.take([...(input.files ?? [])].map(named), side);
            });
            // The same file can be chosen again.
            input.addEventListener('click', () => (input.value = ''));
        }
        by('swap').addEventListener('click', () => this.swap());
        for (const how of ['beside', 'above'] as const) {
            by(`cut-${how}`).addEventListener('click', () => void this.cut(how));
        }
        by('scenes').append(...scenes.map((scene) => this.button(scene)));
        this.listen();
    }

    /** Files from anywhere: one for a slot, or two that are told apart by their names, and a calibration; from a `folder`, where it has a name. */
    async take(files: Named[], side?: Side, folder?: string, scene?: string): Promise<void> {
        const turn = ++this.turn;
        const texts = files.filter(({ name }) => TEXT.test(name) && !OTHER.test(name));
        const others = files.filter(({ name }) => !TEXT.test(name));
        const images = views(others.length > 2 ? others.filter(({ name }) => !OTHER.test(name)) : others);
        if (files.length === 0) {
            return;
        }
        if (images.length > 2 || texts.length > 3) {
            say('pair-problem', `These are ${count(files.length)} files. Take two views, and a calibration if you have one.`);
            return;
        }
        say('pair-problem', undefined);
        say('pair-note', undefined);
        if (this.scene !== undefined && images.length > 0) {
            // One view of one's own does not go with one of a scene.
            this.views = {};
            (['left', 'right'] as const).forEach((side) => this.empty(side));
            this.calibration = this.waiting ? this.calibration : [];
        }
        const complete = () => !this.missing && this.scene === undefined;
        if (texts.length > 0) {
            this.calibration = await Promise.all(texts.map(async ({ file, name }) => ({ name, text: await file.text() })));
            this.waiting = images.length < 2 && !complete();
        } else if (images.length === 2) {
            // That of another pair, unless it came before this one.
            this.calibration = this.waiting ? this.calibration : [];
            this.waiting = false;
        }
        if (images.length > 0) {
            [this.scene, this.name] = [scene, scene ?? folder];
        } else if (this.waiting) {
            say('pair-note', `${texts.map(({ name }) => name).join(', ')} is kept for your pair.`);
            return;
        }
        if (images.length === 2) {
            this.last = undefined;
            this.views = {};
            await Promise.all([this.fill('left', images[0] as Named), this.fill('right', images[1] as Named)]);
        } else if (images[0]) {
            const place = side ?? (this.views.left && !this.views.right ? 'right' : 'left');
            await this.fill(place, images[0]);
            this.last = this.views[place];
            const how = this.whole ? await guess(this.whole.file) : undefined;
            if (how && turn === this.turn) {
                await this.cut(how);
                return;
            }
            this.waiting &&= this.missing !== undefined;
        }
        // Not where a later choice has overtaken this one.
        if (turn === this.turn) {
            this.press();
            by('cut').hidden = !this.whole;
            this.changed(scene !== undefined);
        }
    }

    /** The image that came last, where it has no other one of its size: it may hold both views. */
    private get whole(): View | undefined {
        const sizes = Object.values(this.views).map(({ header: { size } }) => `${size?.width} ${size?.height}`);
        return sizes.length === 2 && sizes[0] === sizes[1] ? undefined : this.last;
    }

    /** Cuts that image into both views. */
    private async cut(how: Cut): Promise<void> {
        const one = this.whole;
        if (!one) {
            return;
        }
        try {
            const [left, right] = await cut(one.file, how);
            const stem = one.name.replace(/\.[^.]*$/, '');
            await this.take([{ file: left, name: `${stem} left.png` }, { file: right, name: `${stem} right.png` }], undefined, stem);
            say('pair-note', how === 'beside' ? 'Cut into its left and right half.' : 'Cut into its upper half, as the left view, and its lower half.');
        } catch (error) {
            say('pair-problem', `${one.name} cannot be cut: ${words(error)}`);
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
            const known = await header(file);
            // What the engine does not read, the browser may.
            const read = known ? file : await decoded(file);
            const found = known ?? (read && (await header(read)));
            if (!read || !found) {
                throw new Error(`${name} is not an image that this browser reads: take ${READS}.`);
            }
            this.problem(side, undefined);
            this.views[side] = { file: read, name, header: found };
            this.hold(side);
        } catch (error) {
            this.problem(side, words(error));
        }
        if (this.views[side]) {
            const bitmap = await createImageBitmap(file).catch(() => undefined);
            this.thumb(side, bitmap);
            bitmap?.close();
        }
    }

    /** The input holds the file of its view, for those who are read what it holds. */
    private hold(side: Side): void {
        const view = this.views[side];
        const transfer = new DataTransfer();
        if (view) {
            transfer.items.add(new File([view.file], view.name));
        }
        by<HTMLInputElement>(`${side}-file`).files = transfer.files;
    }

    private empty(side: Side): void {
        this.label(side, 'choose a file');
        by(side).classList.remove('filled');
        this.problem(side, undefined);
        this.hold(side);
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

    /** Each view takes the place of the other one; the pair is to be matched at once where that is asked. */
    swap(match = false): void {
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
        (['left', 'right'] as const).forEach((side) => this.hold(side));
        this.changed(match);
    }

    private button({ name, title }: Scene): HTMLButtonElement {
        const picture = make('img', { alt: '', width: 96, height: 72 });
        const button = make('button', { type: 'button' }, picture, title);
        button.dataset['scene'] = name;
        button.setAttribute('aria-pressed', 'false');
        button.addEventListener('click', () => void this.open(name));
        return button;
    }

    /** Loads the pictures of the scenes, for which the first map does not wait. */
    illustrate(): void {
        for (const button of by('scenes').querySelectorAll('button')) {
            (button.querySelector('img') as HTMLImageElement).src = `scenes/${button.dataset['scene']}/small.png`;
        }
    }

    /** Opens a scene, and has it matched. */
    async open(name: string): Promise<void> {
        const turn = ++this.turn;
        const get = async (file: string) => {
            const answer = await fetch(`scenes/${name}/${file}`);
            if (!answer.ok) {
                throw new Error(`${answer.status} ${answer.statusText}`);
            }
            return { file: await answer.blob(), name: file === 'calib.txt' ? file : `${name} ${file}` };
        };
        try {
            const files = await Promise.all([get('im0.png'), get('im1.png'), get('calib.txt')]);
            if (turn !== this.turn) {
                return;
            }
            await this.take(files, undefined, undefined, name);
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
                if (event.dataTransfer) {
                    void dropped(event.dataTransfer).then(({ files, folder }) => this.take(files, slot, folder));
                }
            }
        });
        document.addEventListener('paste', (event) => {
            const slot = document.activeElement?.closest('.slot')?.id as Side | undefined;
            void this.take([...(event.clipboardData?.files ?? [])].map(named), slot);
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
