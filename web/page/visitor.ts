// Tracks whether the visitor has interacted, as nothing may move by itself after that.

let touched = false;
for (const kind of ['pointerdown', 'keydown', 'wheel', 'dragenter', 'paste']) {
    addEventListener(kind, () => (touched = true), { capture: true, passive: true, once: true });
}

/** Whether the visitor has only looked so far, allows motion, and has a page so wide (see style.css) that nothing else moves. */
export function onlyLooks(): boolean {
    const wide = matchMedia('(min-width: 561px)').matches;
    return wide && !touched && !calm() && document.visibilityState === 'visible' && scrollY === 0;
}

/** Whether the visitor prefers reduced motion. */
export function calm(): boolean {
    return matchMedia('(prefers-reduced-motion: reduce)').matches;
}
