// The progress bar of a match and the text beside it.

import { by, say } from './dom';
import { left, phase } from './stages';

/** Resets the bar. The result is to be called with each stage, and with the fraction of the match done, 0 to 1. */
export function followed(): (stage: string, done: number) => void {
    const bar = by<HTMLProgressElement>('progress');
    let said = 0;
    let last = 0;
    let since = performance.now();
    bar.value = 0;
    say('stage', 'Getting ready');
    return (stage, done) => {
        if (done < last) {
            // A second match over a wider range.
            [since, said] = [performance.now(), 0];
        }
        [last, bar.value] = [done, done];
        const parts = [phase(stage), `${Math.floor(100 * done)} %`, left(done, performance.now() - since)].filter(Boolean);
        bar.setAttribute('aria-valuetext', parts.join(', '));
        say('stage', parts.join(' · '));
        if (done >= said + 0.25) {
            said = Math.floor(4 * done) / 4;
            say('announce', `${100 * said} percent`);
        }
    };
}
