// Names of the steps of a match, and the remaining time.

const PREPARING = new Set(['half_size', 'double_size', 'illumination', 'conditioning', 'zones', 'matches', 'label_range', 'upload']);
const CLEANING = new Set([
    ...['refine', 'left_right_check', 'speckle_filter', 'confidence', 'fill', 'vote_fill', 'fill_plane', 'plane', 'far_plane', 'median'],
    ...['support', 'enlarge', 'download'],
]);

/** The description of a step. */
export function phase(stage: string): string {
    return PREPARING.has(stage) ? 'Preparing the views' : CLEANING.has(stage) ? 'Cleaning up' : 'Matching';
}

/** Limits below which the remaining time is not estimated. */
const EARLY = { done: 0.05, time: 1000 };

/** The remaining time in words, extrapolated from the share `done`; undefined while too early. */
export function left(done: number, milliseconds: number): string | undefined {
    if (done < EARLY.done || milliseconds < EARLY.time) {
        return undefined;
    }
    const seconds = ((milliseconds / done) * (1 - done)) / 1000;
    if (seconds < 2.5) {
        return 'a few seconds left';
    }
    return seconds < 90 ? `about ${seconds < 10 ? Math.round(seconds) : 5 * Math.round(seconds / 5)} s left` : `about ${Math.round(seconds / 60)} min left`;
}
