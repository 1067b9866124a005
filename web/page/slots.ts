// The slots of the two views and their sources: drop, paste, file dialog, rendered scene.

import { type Halves, both } from './both';
import { cut, decoded, guess, views } from './decode';
import { by, count, make, say, words } from './dom';
import { type Named, TEXT, dropped, named } from './dropped';
import { type Header, header, isHeif } from './header';
import { inOrder, ordered } from './order';
import { apart } from './prior';
import type { Picture, Text } from './protocol';
import { Turns } from './turns';

export type Side = 'left' | 'right';
const SIDES = ['left', 'right'] as const;

export interface View {
    file: Blob;
    name: string;
    header: Header;
    /** The thumbnail in the slot, hidden until it is drawn. */
    thumb: HTMLCanvasElement;
    /** Whether the user has chosen the side. */
    placed: boolean;
    /** The calibration given with its pair. */
    calibration: Text[];
}

type Views = Partial<Record<Side, View>>;

/** A rendered scene of the project, listed by the build. */
export interface Scene {
    name: string;
    title: string;
}

/** What to do with a changed pair. */
export interface Wish {
    /** Match at once. */
    match?: boolean;
    /** Rectify by matches. */
    rectify?: 'matches';
    /** The same pair, so its rectification stays. */
    same?: boolean;
}

/** Where files come from. */
interface Source {
    /** The slot that they were given to. */
    side?: Side | undefined;
    /** Name of the pair, if it is not that of its files. */
    name?: string | undefined;
    /** The scene that they belong to. */
    scene?: string | undefined;
    /** What is known of the left view. */
    prior?: Named | undefined;
    wish?: Wish;
}

/** What was done to an image with both views. */
function cutting(parts: Halves | [Blob, Blob]): string {
    if (Array.isArray(parts)) {
        return 'The file holds both views.';
    }
    if (!parts.leftFirst) {
        return `Cut into its halves. The file has the right view ${parts.how === 'beside' ? 'on the left' : 'above the left one'}.`;
    }
    return parts.how === 'beside' ? 'Cut into its left and right half.' : 'Cut into its upper half, as the left view, and its lower half.';
}

const isFilm = ({ file, name }: Named): boolean => file.type.startsWith('video/') || /\.(mp4|m4v|mov|webm|mkv|avi)$/i.test(name);
const other = (side: Side): Side => (side === 'left' ? 'right' : 'left');
const listed = (files: { name: string }[]): string => files.map(({ name }) => name).join(', ');
const untimely = ({ name }: Named): string => `Give ${name} once both views are there: it is of the left one.`;
const keeping = (files: Text[]): string => `${listed(files)} is kept for your pair.`;
/** The files that a calibration may have. */
const MOST = 3;
const READS = 'PNG, JPEG, WebP, AVIF, GIF, PNM, TIFF or PFM';
/** Other files in the folders of benchmarks. */
const OTHER = /^(disp|mask|readme|license|\.)|GT\b|\.(pfm|py|md)$/i;

export class Slots {
    /** Changes only together with everything else about the pair, once new files are read. */
    views: Views = {};
    /** The scene of the views. */
    scene: string | undefined;
    /** Name of the pair, if it is not that of its files. */
    name: string | undefined;
    /** What is known of the left view, as long as the page can use it. */
    prior: Named | undefined;
    /** Whether the user has not given or asked for anything yet. */
    untouched = true;
    /** The last image, if it came alone. */
    private last: View | undefined;
    /** A calibration that was given before its pair. */
    private kept: Text[] = [];
    /** Resolves when all given files are processed. */
    private queue: Promise<void> = Promise.resolve();
    /** The scene being fetched. */
    private readonly fetches = new Turns();

    /** `changed` is called after every change of a view or of the calibration; `isWhole` says whether files are all of a calibration; `film` takes
     * films. */
    constructor(
        scenes: Scene[],
        private readonly changed: (wish: Wish) => void,
        private readonly isWhole: (files: Text[]) => Promise<boolean>,
        private readonly film: (film: Named) => void,
    ) {
        for (const side of SIDES) {
            const input = by<HTMLInputElement>(`${side}-file`);
            input.addEventListener('change', () => {
                void this.take([...(input.files ?? [])].map(named), { side });
            });
            // Allows the same file to be chosen again.
            input.addEventListener('click', () => (input.value = ''));
            input.addEventListener('cancel', () => this.hold(side));
        }
        const input = by<HTMLInputElement>('prior-file');
        input.addEventListener('change', () => {
            const [file] = [...(input.files ?? [])].map(named);
            if (file) {
                void this.inTurn(async () => this.know(file));
            }
        });
        input.addEventListener('click', () => (input.value = ''));
        by('add-prior').addEventListener('click', () => input.click());
        by('forget-prior').addEventListener('click', () => void this.inTurn(async () => this.know(undefined)));
        by('swap').addEventListener('click', () => void this.swap());
        for (const how of ['beside', 'above'] as const) {
            by(`cut-${how}`).addEventListener('click', () => void this.inTurn(() => this.cut(this.whole(this.views), { how, leftFirst: true })));
        }
        by('scenes').append(...scenes.map((scene) => this.button(scene)));
        this.listen();
    }

    /** The files of the calibration. */
    get calibration(): Text[] {
        return SIDES.map((side) => this.views[side]?.calibration ?? []).find((files) => files.length > 0) ?? [];
    }

    /** Runs actions one after another in order of arrival, as each depends on the state left by the one before. */
    private inTurn(act: () => Promise<void>): Promise<void> {
        this.untouched = false;
        this.queue = this.queue.then(act).catch((error) => say('pair-problem', words(error)));
        return this.queue;
    }

    /** Takes files: one for a slot, or two that are told apart by their names, and a calibration. */
    take(files: Named[], source: Source = {}): Promise<void> {
        return files.length > 0 ? this.inTurn(() => this.add(files, source)) : Promise.resolve();
    }

    /** Takes files, or reports why not and changes nothing. */
    private async add(all: Named[], given: Source): Promise<void> {
        this.quiet();
        const film = all.find(isFilm);
        if (film) {
            this.film(film);
            return;
        }
        const { prior, others: files } = await apart(all, given.name !== undefined, this.missing === undefined);
        if (prior && files.length === 0) {
            this.know(prior);
            return;
        }
        const source = { ...given, prior };
        const { side } = source;
        const texts = files.filter(({ name }) => TEXT.test(name) && !OTHER.test(name));
        const others = files.filter(({ name }) => !TEXT.test(name));
        const likely = others.filter(({ name }) => !OTHER.test(name));
        const images = views((others.length > 2 || source.name !== undefined) && likely.length > 0 ? likely : others);
        if (images.length > 2 || texts.length > MOST) {
            throw new Error(`These are ${count(files.length)} files. Take two views, and a calibration if you have one.`);
        }
        if (images.length + texts.length === 0) {
            throw new Error(`There is no view and no calibration in ${source.name ?? (listed(files) || 'what was dropped')}.`);
        }
        let read: View[];
        try {
            read = await Promise.all(images.map((image) => this.read(image, side !== undefined)));
        } catch (error) {
            if (!side || images.length > 1) {
                throw error;
            }
            this.problem(side, words(error));
            return;
        }
        const written = await Promise.all(texts.map(async ({ file, name }) => ({ name, text: await file.text() })));
        const calibration = await this.completed(this.own && images.length === 0 ? this.calibration : this.kept, written);
        const [one, two] = read;
        if (one && two) {
            this.put({ left: one, right: two }, source, calibration);
            if (others.length > 2) {
                say('pair-note', `Of ${count(files.length)} files ${one.name} and ${two.name} are the views.`);
            }
        } else if (one) {
            await this.addOne(one, source, calibration);
        } else {
            this.calibrate(calibration, prior);
        }
    }

    /** Takes one image, which may hold both views. */
    private async addOne(view: View, source: Source, calibration: Text[]): Promise<void> {
        const { side } = source;
        const before = this.scene === undefined ? this.views : {};
        const pair = before.left !== undefined && before.right !== undefined;
        const views = this.joined(before, view, side);
        const said = await both(view.file, view.name);
        const how = said ? undefined : this.whole(views, view) && (await guess(view.file));
        const parts = said ?? (how && { how, leftFirst: true });
        let problem: string | undefined;
        if (parts) {
            try {
                await this.cut(view, parts, calibration, source.prior);
                return;
            } catch (error) {
                problem = words(error);
            }
        }
        const beside = side && pair ? views[other(side)] : undefined;
        // Not if both views are replaced one after the other.
        const stays = beside !== this.last ? beside : undefined;
        this.put(views, source, calibration, view);
        say('pair-problem', problem);
        if (side && stays) {
            const files = listed(this.calibration);
            say('pair-note', `${stays.name} is still the ${other(side)} view${files && `, and ${files} the calibration`}.`);
        } else if (this.missing) {
            const begins = pair ? `${view.name} begins a new pair. Give its other view, too. ` : '';
            const known = source.prior ? `${untimely(source.prior)} ` : '';
            say('pair-note', `${begins}${known}${calibration.length > 0 ? keeping(calibration) : ''}`.trim());
        }
    }

    /** Whether both views are there, and no scene's. */
    private get own(): boolean {
        return this.views.left !== undefined && this.views.right !== undefined && this.scene === undefined;
    }

    /** New files of a calibration, with those before them that they complete. */
    private async completed(before: Text[], files: Text[]): Promise<Text[]> {
        if (before.length === 0 || files.length === 0 || (await this.isWhole(files)) || (await this.isWhole(before))) {
            return files;
        }
        // A file takes the place of one of its name.
        const others = before.filter(({ name }) => files.every((file) => file.name !== name));
        // With the last one alone, and then with those before it, which may be of another calibration.
        const sets = others.map((_, i) => ordered([...others.slice(others.length - 1 - i), ...files])).filter(({ length }) => length <= MOST);
        for (const set of sets) {
            if (await this.isWhole(set)) {
                return set;
            }
        }
        // A third file may be missing yet.
        return sets.at(-1) ?? files;
    }

    /** A calibration without views. */
    private calibrate(files: Text[], prior = this.prior): void {
        const { left, right } = this.views;
        if (left && right && this.scene === undefined) {
            this.put({ left, right }, { name: this.name, prior }, files, this.last);
        } else {
            this.kept = files;
            say('pair-note', `${prior && prior !== this.prior ? `${untimely(prior)} ` : ''}${keeping(files)}`);
        }
    }

    /** Takes what is known of the left view, or forgets it. */
    private know(prior: Named | undefined): void {
        if (prior && this.missing) {
            throw new Error(untimely(prior));
        }
        this.prior = prior;
        this.quiet();
        this.render();
        this.changed({ same: true });
    }

    /** Forgets what is known, as it does not fit the pair. */
    cannotUse(prior: Named): void {
        if (this.prior === prior) {
            this.prior = undefined;
            this.render();
        }
    }

    /** Adds a view: in its slot, or in an empty one; with none empty it begins a new pair. */
    private joined(views: Views, view: View, side: Side | undefined): Views {
        if (side) {
            return { ...views, [side]: view };
        }
        const { left, right } = views;
        const held = left ?? right;
        if (!held || (left && right)) {
            return { left: view };
        }
        const [one, two] = held.placed ? (left ? [left, view] : [view, held]) : inOrder(held, view);
        return { left: one, right: two };
    }

    /** Sets the views, one of which may have come `alone`. */
    private put(views: Views, { scene, name = scene, wish = {}, prior }: Source, calibration: Text[] = [], alone?: View): void {
        const { left, right } = views;
        if (scene === undefined) {
            // Files from the user take precedence over a scene that is still loading.
            this.fetches.next();
        }
        [this.views, this.scene, this.name, this.last] = [views, scene, name, alone];
        this.prior = left && right ? prior : undefined;
        if (left && right) {
            const before = scene === undefined && this.calibration.length === 0 ? this.kept : [];
            const given = calibration.length > 0 ? calibration : before;
            if (given.length > 0) {
                left.calibration = right.calibration = given;
            }
            if (scene === undefined) {
                this.kept = [];
            }
        } else if (calibration.length > 0) {
            this.kept = calibration;
        }
        this.quiet();
        this.render();
        this.changed(wish);
    }

    /** The last image, if no other has its size, so that it may hold both views. */
    private whole(views: Views, last = this.last): View | undefined {
        const sizes = Object.values(views).map(({ header: { size } }) => `${size?.width} ${size?.height}`);
        return sizes.length === 2 && sizes[0] === sizes[1] ? undefined : last;
    }

    /** Splits an image into both views, or takes the two that its file holds. */
    private async cut(one: View | undefined, parts: Halves | [Blob, Blob], calibration: Text[] = [], prior?: Named): Promise<void> {
        if (!one) {
            return;
        }
        try {
            const name = one.name.replace(/\.[^.]*$/, '');
            const files = Array.isArray(parts) ? parts : await cut(one.file, parts.how);
            const [first, second] = Array.isArray(parts) || parts.leftFirst ? files : [files[1], files[0]];
            const end = Array.isArray(parts) ? 'jpg' : 'png';
            const [left, right] = await Promise.all([
                this.read({ file: first, name: `${name} left.${end}` }),
                this.read({ file: second, name: `${name} right.${end}` }),
            ]);
            this.put({ left, right }, { name, prior }, calibration);
        } catch (error) {
            throw new Error(`${one.name} cannot be cut: ${words(error)}`);
        }
        say('pair-note', cutting(parts));
    }

    /** Reports a problem at the slot of a view. */
    problem(side: Side, text: string | undefined): void {
        say(`${side}-problem`, text);
        by<HTMLInputElement>(`${side}-file`).setAttribute('aria-invalid', String(Boolean(text)));
    }

    /** Clears the messages about the pair. */
    private quiet(): void {
        SIDES.forEach((side) => this.problem(side, undefined));
        say('pair-problem', undefined);
        say('pair-note', undefined);
    }

    /** Shows the engine's picture of a view, which also works for formats that the browser cannot decode. */
    show(side: Side, picture: Picture): void {
        const whole = new OffscreenCanvas(picture.width, picture.height);
        whole.getContext('2d')?.putImageData(new ImageData(picture.pixels, picture.width, picture.height), 0, 0);
        const view = this.views[side];
        if (view) {
            draw(view.thumb, whole);
        }
    }

    private async read({ file, name }: Named, placed = false): Promise<View> {
        const known = await header(file).catch((error) => {
            throw new Error(`${name} cannot be read: ${words(error)}`);
        });
        // The browser may decode formats that the engine does not read.
        const read = known ? file : await decoded(file);
        const found = known ?? (read && (await header(read)));
        if (!read || !found) {
            throw new Error(
                (await isHeif(file))
                    ? `${name} is a HEIC photo, which this browser does not read. Share or save it as JPEG: on an iPhone, choose Settings, Camera, Formats, Most Compatible.`
                    : `${name} is not an image that this browser reads: take ${READS}.`,
            );
        }
        return { file: read, name, header: found, thumb: make('canvas', { hidden: true }), placed, calibration: [] };
    }

    /** Updates the slots. */
    private render(): void {
        for (const side of SIDES) {
            const [slot, view] = [by(side), this.views[side]];
            const label = slot.querySelector('.name') as HTMLElement;
            label.textContent = label.title = view?.name ?? 'choose a file';
            slot.classList.toggle('filled', view !== undefined);
            slot.querySelector('.thumb')?.replaceChildren(...(view ? [view.thumb] : []));
            this.hold(side);
            if (view) {
                void preview(view);
            }
        }
        for (const button of by('scenes').querySelectorAll('button')) {
            button.setAttribute('aria-pressed', String(button.dataset['scene'] === this.scene));
        }
        by('cut').hidden = !this.whole(this.views);
        by('add-prior').hidden = this.missing !== undefined || this.prior !== undefined;
        by('forget-prior').hidden = this.prior === undefined;
    }

    /** Puts the file of a view into its input, for screen readers. */
    private hold(side: Side): void {
        const view = this.views[side];
        const transfer = new DataTransfer();
        if (view) {
            transfer.items.add(new File([view.file], view.name));
        }
        by<HTMLInputElement>(`${side}-file`).files = transfer.files;
    }

    /** Swaps the views, and matches them at once if requested. Does nothing if `signal` has been aborted. */
    swap(match = false, signal?: AbortSignal): Promise<void> {
        return this.inTurn(async () => {
            const { left, right } = this.views;
            if (signal?.aborted || (!left && !right)) {
                return;
            }
            for (const view of Object.values(this.views)) {
                view.placed = true;
            }
            this.views = { ...(right && { left: right }), ...(left && { right: left }) };
            this.quiet();
            this.render();
            this.changed({ match, same: true });
        });
    }

    private button({ name, title }: Scene): HTMLButtonElement {
        const picture = make('img', { alt: '', width: 96, height: 72 });
        const button = make('button', { type: 'button' }, picture, title);
        button.dataset['scene'] = name;
        button.setAttribute('aria-pressed', 'false');
        button.addEventListener('click', () => void this.open(name));
        return button;
    }

    /** Loads the thumbnails of the scenes after the first map. */
    illustrate(): void {
        for (const button of by('scenes').querySelectorAll('button')) {
            (button.querySelector('img') as HTMLImageElement).src = `scenes/${button.dataset['scene']}/small.png`;
        }
    }

    /** Opens a scene and matches it. */
    async open(name: string): Promise<void> {
        this.untouched = false;
        const signal = this.fetches.next();
        const get = async (file: string) => {
            const answer = await fetch(`scenes/${name}/${file}`, { signal });
            if (!answer.ok) {
                throw new Error(`${answer.status} ${answer.statusText}`);
            }
            return { file: await answer.blob(), name: file === 'calib.txt' ? file : `${name} ${file}` };
        };
        try {
            const files = await Promise.all([get('im0.png'), get('im1.png'), get('calib.txt')]);
            await this.inTurn(async () => {
                if (!signal.aborted) {
                    await this.add(files, { scene: name, wish: { match: true } });
                }
            });
        } catch (error) {
            if (!signal.aborted) {
                say('pair-problem', `The scene could not be loaded (${words(error)}). Offline, only scenes that were opened before are at hand.`);
            }
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
                const side = (event.target as Element | null)?.closest?.('.slot')?.id as Side | undefined;
                if (event.dataTransfer) {
                    const found = dropped(event.dataTransfer).catch((error) => new Error(`What was dropped cannot be read: ${words(error)}`));
                    void this.inTurn(async () => {
                        const drop = await found;
                        if (drop instanceof Error) {
                            throw drop;
                        }
                        await this.add(drop.files, { side, name: drop.folder });
                    });
                }
            }
        });
        document.addEventListener('paste', (event) => {
            const side = document.activeElement?.closest('.slot')?.id as Side | undefined;
            void this.take([...(event.clipboardData?.files ?? [])].map(named), { side });
        });
    }

    /** The first view that is missing. */
    get missing(): Side | undefined {
        return SIDES.find((side) => !this.views[side]);
    }

    /** Asks for the missing view at its slot. */
    askFor(side: Side): void {
        if (!by(`${side}-problem`).textContent) {
            const has = this.views[other(side)] ? ' too' : '';
            this.problem(side, `Choose the ${side} view${has}.`);
        }
        by(`${side}-file`).focus();
    }
}

/** The browser's preview of a view, until the engine provides its own. */
async function preview({ file, thumb }: View): Promise<void> {
    const bitmap = thumb.hidden ? await createImageBitmap(file).catch(() => undefined) : undefined;
    if (bitmap && thumb.hidden) {
        draw(thumb, bitmap);
    }
    bitmap?.close();
}

/** Draws a thumbnail. */
function draw(canvas: HTMLCanvasElement, image: CanvasImageSource & { width: number; height: number }): void {
    const scale = Math.min(1, 320 / Math.max(image.width, image.height));
    [canvas.width, canvas.height] = [image.width, image.height].map((s) => Math.max(1, Math.round(s * scale))) as [number, number];
    const context = canvas.getContext('2d');
    if (context) {
        context.imageSmoothingQuality = 'high';
        context.drawImage(image, 0, 0, canvas.width, canvas.height);
    }
    canvas.hidden = false;
}
