// The surface tab: its cameras, and the filter by confidence.

import { by, count, say, words } from './dom';
import { canRecord } from './film';
import type { Maps } from './mesh';
import type { Cameras, Picture } from './protocol';
import { share } from './save';
import type { SurfaceView } from './surface-view';
import { Turns } from './turns';

const FIELDS = { focalLength: 'focal-length', cx: 'cx', cy: 'cy', doffs: 'doffs', baseline: 'baseline' } as const;
type Field = keyof typeof FIELDS;
const ALL = Object.keys(FIELDS) as Field[];
const field = (key: Field) => by<HTMLInputElement>(FIELDS[key]);

/** Source of the cameras. */
type Source = 'calibration' | 'given' | 'guess';

const NOTES: Record<Exclude<Source, 'calibration'>, string> = {
    given: 'As given here. Depths have the unit of the baseline.',
    guess: 'A guess, so not to scale: the focal length is the width of the image, the baseline is 1. Give your own, or drop a calibration.',
};

/** What the surface is made of, and the prefix of its files. */
interface Shown extends Maps {
    left: Picture;
    name: string;
}

export class SurfaceTab {
    private view: SurfaceView | undefined;
    private source: Source = 'guess';
    /** File names of the calibration. */
    private files = '';
    private size = { width: 0, height: 0 };
    /** Whether the surface shown is of this result and these cameras. */
    private fresh = false;
    /** Number of points with at least this confidence. */
    private atLeast = new Uint32Array(257);
    /** Every how many rows and columns there is a point. */
    private step = 1;
    /** Number of points that were measured; the others are filled. */
    private measured = 0;
    private open = false;
    /** The surface that is being made. */
    private readonly turns = new Turns();
    /** The film that is being made. */
    private readonly films = new Turns();

    /** `maps` are those of the result; `changed` is called when the cameras change. */
    constructor(
        private readonly maps: () => Shown | undefined,
        private readonly changed: () => void,
    ) {
        for (const key of ALL) {
            field(key).addEventListener('change', () => {
                this.source = 'given';
                this.renew();
            });
        }
        by('unit').addEventListener('change', () => this.renew());
        by('least').addEventListener('input', () => this.filter());
        by('reset-view').addEventListener('click', () => this.view?.rest());
        by('film').hidden = !canRecord();
        by('film').addEventListener('click', () => void this.film());
    }

    /** The cameras of the form; undefined if a number is missing or invalid. */
    get cameras(): Cameras | undefined {
        const of = (key: Field) => field(key).valueAsNumber;
        const cameras = { focalLength: of('focalLength'), cx: of('cx'), cy: of('cy'), doffs: of('doffs'), baseline: of('baseline') };
        const sound = Object.values(cameras).every(Number.isFinite) && cameras.focalLength > 0 && cameras.baseline > 0;
        return sound ? { ...cameras, unit: by<HTMLSelectElement>('unit').value } : undefined;
    }

    /** The cameras, unless they are a guess. */
    get known(): Cameras | undefined {
        return this.source === 'guess' ? undefined : this.cameras;
    }

    get leastConfidence(): number {
        return by<HTMLInputElement>('least').valueAsNumber;
    }

    /** Takes a new pair, with its cameras if a calibration gives them. */
    pair(width: number, height: number, read: Cameras | undefined, files: string): void {
        this.files = files;
        // Typed cameras are kept for the next pair of the same size.
        const same = this.size.width === width && this.size.height === height;
        this.size = { width, height };
        if (read || this.source !== 'given' || !same || !this.cameras) {
            this.source = read ? 'calibration' : 'guess';
            const guess = { focalLength: width, cx: (width - 1) / 2, cy: (height - 1) / 2, doffs: 0, baseline: 1, unit: 'unknown' };
            const cameras = read ?? guess;
            by<HTMLSelectElement>('unit').value = cameras.unit;
            for (const key of ALL) {
                field(key).value = String(cameras[key]);
            }
        }
        this.note();
    }

    /** Clears everything but typed cameras. */
    forget(): void {
        this.result(false);
        if (this.source !== 'given') {
            this.source = 'guess';
            by<HTMLSelectElement>('unit').value = 'unknown';
            for (const key of ALL) {
                field(key).value = '';
            }
            say('cameras-note', undefined);
            say('cameras-problem', undefined);
        }
    }

    /** Called when there is a result or none any more; drops the earlier surface. */
    result(there: boolean): void {
        this.turns.next();
        this.view?.clear();
        this.fresh = false;
        by('surface').dataset['points'] = '';
        say('surface-note', there ? undefined : 'The surface of the next result appears here.');
        if (there && this.open) {
            void this.show();
        }
    }

    /** Called when this tab or another one is selected. */
    select(open: boolean, there: boolean): void {
        this.open = open;
        if (open && there && !this.fresh) {
            void this.show();
        } else if (open && !there) {
            say('surface-note', 'The surface of the next result appears here.');
        }
    }

    /** Loads the viewer, so that the surface appears at once. Returns whether there is one to show. */
    async prepare(): Promise<boolean> {
        try {
            await this.viewer();
            return this.cameras !== undefined;
        } catch {
            return false;
        }
    }

    private async viewer(): Promise<SurfaceView> {
        const { SurfaceView } = await import('./surface-view');
        this.view ??= new SurfaceView(by<HTMLCanvasElement>('surface-canvas'), (swings) => {
            by('reset-view').textContent = swings ? 'Stop' : 'Reset view';
        });
        return this.view;
    }

    private renew(): void {
        this.turns.next();
        this.fresh = false;
        this.note();
        this.changed();
        if (this.open) {
            void this.show();
        }
    }

    private note(): void {
        say('cameras-note', this.source === 'calibration' ? `From ${this.files}. Depths have the unit of its baseline.` : NOTES[this.source]);
        const sound = this.cameras !== undefined;
        say('cameras-problem', sound ? undefined : 'All five take a number; focal length and baseline one above 0.');
    }

    private async show(): Promise<void> {
        const cameras = this.cameras;
        if (!cameras || this.size.width === 0) {
            return;
        }
        const signal = this.turns.next();
        this.fresh = true;
        try {
            if (!this.view) {
                say('surface-note', 'Loading the viewer …');
            }
            const [view, { mesh }] = await Promise.all([this.viewer(), import('./mesh')]);
            signal.throwIfAborted();
            const maps = this.maps();
            if (!maps) {
                return;
            }
            const surface = mesh(maps, cameras, maps.left, 0);
            view.show(surface, cameras, maps.width, maps.height);
            [this.step, this.measured] = [surface.step, surface.measured];
            this.tally(surface.confidences);
            this.reach();
            this.filter();
        } catch (error) {
            if (signal.aborted) {
                return;
            }
            this.fresh = false;
            say('surface-note', `The surface cannot be shown: ${words(error)}`);
        }
    }

    private tally(confidences: Uint8Array): void {
        this.atLeast.fill(0);
        for (const confidence of confidences) {
            this.atLeast[confidence] = (this.atLeast[confidence] ?? 0) + 1;
        }
        for (let i = 254; i >= 0; i -= 1) {
            this.atLeast[i] = (this.atLeast[i] ?? 0) + (this.atLeast[i + 1] ?? 0);
        }
    }

    /** Limits the slider to the confidence of the best percent of the points. */
    private reach(): void {
        const slider = by<HTMLInputElement>('least');
        const all = this.atLeast[0] ?? 0;
        slider.max = String(Math.max(1, this.atLeast.findLastIndex((left) => 100 * left >= all)));
    }

    private filter(): void {
        const least = this.leastConfidence;
        by('least-value').textContent = String(least);
        this.view?.atLeast(least);
        if (this.fresh) {
            const [shown, all] = [this.atLeast[least] ?? 0, this.atLeast[0] ?? 0];
            by('surface').dataset['points'] = String(shown);
            const every = this.step > 1 ? ` of one pixel in ${this.step * this.step}` : '';
            const some = least > 0 ? `${count(shown)} of ${count(all)} points` : `${count(all)} points`;
            const filled = all - this.measured;
            const told = least === 0 && filled > 0 ? ` ${count(filled)} are filled; a least confidence of 1 hides them.` : '';
            say('surface-note', `${some}${every}.${told}`);
        }
    }

    /** Films the surface, and shares or saves the film. */
    private async film(): Promise<void> {
        const [view, maps] = [this.view, this.maps()];
        if (!view || !maps || !this.fresh) {
            return;
        }
        const signal = this.films.next(this.turns.signal);
        const button = by<HTMLButtonElement>('film');
        button.disabled = true;
        say('surface-note', 'Filming one swing, 6 seconds …');
        try {
            await share(await view.film(`${maps.name}-film`, signal));
            this.filter();
        } catch (error) {
            if (!signal.aborted) {
                say('surface-note', `The film cannot be made: ${words(error)}`);
            }
        } finally {
            button.disabled = false;
        }
    }
}
