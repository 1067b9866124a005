// Warnings and notes about a pair and its result, with buttons for remedies.

import { by, make, sentence } from './dom';
import type { Range, Warning } from './protocol';

/** Actions of the buttons. Each matches again. */
export interface Help {
    swap(): void;
    rectify(): void;
    widen(range: Range): void;
    /** Without rectification. */
    asTheyAre(): void;
    atFullSize(): void;
}

const REMEDIES: Record<NonNullable<Warning['remedy']>, string> = { swap: 'Swap the views', rectify: 'Rectify', widen: 'Widen the range' };

export class Remarks {
    constructor(private readonly help: Help) {}

    /** Shows warnings. */
    warn(warnings: Warning[]): void {
        const unique = warnings.filter(({ text }, i) => warnings.findIndex((other) => other.text === text) === i);
        by('warnings').replaceChildren(
            ...unique.map((warning) => {
                const { text, remedy } = warning;
                return make('li', {}, `${sentence(text)} `, ...(remedy ? [button(REMEDIES[remedy], () => this.act(warning))] : []));
            }),
        );
    }

    /** Shows notes, with buttons to undo a rectification, and to use full size if the memory was `short`. */
    note(notes: string[], rectified: boolean, short = false): void {
        const lines = notes.map((text) => make('li', {}, `${sentence(text)}. `));
        if (rectified) {
            lines[0]?.append(button('Undo rectification', () => this.help.asTheyAre()));
        }
        if (short) {
            const full = button('Match at full size', () => this.help.atFullSize());
            const why = 'At full size this pair takes more memory than a match may have here, so it was matched at half its size. ';
            lines.push(make('li', {}, why, full));
        }
        by('notes').replaceChildren(...lines);
    }

    clear(): void {
        by('warnings').replaceChildren();
        by('notes').replaceChildren();
    }

    private act({ remedy, min, max }: Warning): void {
        if (remedy === 'swap') {
            this.help.swap();
        } else if (remedy === 'rectify') {
            this.help.rectify();
        } else if (remedy === 'widen' && min !== undefined && max !== undefined) {
            this.help.widen({ min, max });
        }
    }
}

function button(text: string, act: () => void): HTMLButtonElement {
    const made = make('button', { type: 'button' }, text);
    made.addEventListener('click', act);
    return made;
}
