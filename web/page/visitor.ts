// Whether a visitor has done anything yet: what moves by itself must not move away under somebody's hand.

let touched = false;
for (const kind of ['pointerdown', 'keydown', 'wheel', 'dragenter', 'paste']) {
    addEventListener(kind, () => (touched = true), { capture: true, passive: true, once: true });
}

/** Whether the visitor has only looked so far and does not mind motion, on a page wide enough (see style.css) that nothing else moves. */
export function onlyLooks(): boolean {
    const wide = matchMedia('(min-width: 561px)').matches;
    return wide && !touched && !calm() && document.visibilityState === 'visible' && scrollY === 0;
}

/** Whether the visitor wants no motion. */
export function calm(): boolean {
    return matchMedia('(prefers-reduced-motion: reduce)').matches;
}
