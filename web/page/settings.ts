// Preset, range and device in the form.

import { by, make, say } from './dom';
import type { Device, Preset, Range, Size } from './protocol';

const radio = (name: string) => document.querySelector<HTMLInputElement>(`input[name="${name}"]:checked`)?.value;

export class Settings {
    private presets: Preset[] = [];
    /** The preset chosen by the user. */
    chosen: string | undefined;
    /** Whether the user has typed a range; the page may also fill it in. */
    private typed = false;
    /** Whether the user has chosen the size. */
    private sized = false;
    /** Size of the pair. */
    private pixels = { width: 0, height: 0 };

    /** `ranged` is called when the range changes. */
    constructor(ranged: () => void) {
        by('preset').addEventListener('change', () => {
            this.chosen = this.preset;
            this.about();
        });
        for (const input of document.querySelectorAll('input[name="range"]')) {
            input.addEventListener('change', () => {
                by('ends').hidden = this.automatic;
                this.typed = true;
                ranged();
            });
        }
        for (const id of ['min', 'max']) {
            by(id).addEventListener('change', () => {
                this.typed = true;
                ranged();
            });
        }
        by('size').addEventListener('change', () => (this.sized = true));
    }

    get preset(): string {
        return by<HTMLSelectElement>('preset').value;
    }

    get device(): Device {
        return radio('device') as Device;
    }

    get size(): Size {
        return by<HTMLSelectElement>('size').value as Size;
    }

    /** Matches this pair at full size. */
    atFullSize(): void {
        by<HTMLSelectElement>('size').value = 'full';
        this.sized = false;
    }

    /** Takes a new pair: resets what the page has set, and a typed range unless the size is the same. */
    pair(width: number, height: number): void {
        const same = this.pixels.width === width && this.pixels.height === height;
        const first = this.pixels.width === 0;
        this.pixels = { width, height };
        if (!this.sized) {
            by<HTMLSelectElement>('size').value = 'automatic';
        }
        if (!this.automatic && !(this.typed && (same || first))) {
            (document.querySelector('input[name="range"][value="automatic"]') as HTMLInputElement).checked = true;
            by('ends').hidden = true;
        }
    }

    get automatic(): boolean {
        return radio('range') === 'automatic';
    }

    /** The typed range; undefined if invalid. */
    get given(): Range | undefined {
        const [min, max] = ['min', 'max'].map((id) => by<HTMLInputElement>(id).valueAsNumber) as [number, number];
        return Number.isInteger(min) && Number.isInteger(max) && min <= max ? { min, max } : undefined;
    }

    /** Applies the settings in a link, ignoring invalid ones. */
    take(link: URLSearchParams): void {
        const preset = link.get('preset');
        if (this.presets.some(({ name }) => name === preset) && preset) {
            by<HTMLSelectElement>('preset').value = this.chosen = preset;
            this.about();
        }
        const [min, max] = (link.get('range') ?? '').split(',').map((end) => (end === '' ? NaN : Number(end)));
        if (min !== undefined && max !== undefined && Number.isInteger(min) && Number.isInteger(max) && min <= max) {
            this.give({ min, max });
            this.typed = true;
            // The range is that of the pair of the link, whatever its size.
            this.pixels = { width: 0, height: 0 };
        }
    }

    offer(presets: Preset[]): void {
        this.presets = presets;
        by('preset').append(...presets.map(({ name }) => make('option', { textContent: name })));
        this.about();
    }

    /** Disables the GPU and says why. Selects the fast preset unless the user has chosen one. */
    withoutGpu(reason: string): void {
        const [gpu, cpu] = ['gpu', 'cpu'].map((value) => document.querySelector<HTMLInputElement>(`input[value="${value}"]`));
        if (gpu && cpu) {
            gpu.disabled = true;
            cpu.checked = true;
        }
        if (!this.chosen) {
            by<HTMLSelectElement>('preset').value = 'fast';
            this.about();
        }
        say('device-note', reason);
    }

    /** Fills in a found range as the start for a typed one. */
    suggest({ min, max }: Range): void {
        by<HTMLInputElement>('min').value = String(min);
        by<HTMLInputElement>('max').value = String(max);
    }

    /** Sets a range instead of the automatic one. */
    give(range: Range): void {
        (document.querySelector('input[name="range"][value="given"]') as HTMLInputElement).checked = true;
        by('ends').hidden = false;
        this.typed = false;
        this.suggest(range);
    }

    private about(): void {
        say('preset-about', this.presets.find(({ name }) => name === this.preset)?.about);
    }
}
