// A tab list with arrow keys as in the ARIA practices.

export function tabs(list: HTMLElement, selected: (tab: HTMLElement) => void): { select(tab: HTMLElement): void } {
    const all = [...list.querySelectorAll<HTMLElement>('[role="tab"]')];
    const select = (tab: HTMLElement) => {
        for (const other of all) {
            other.setAttribute('aria-selected', String(other === tab));
            other.tabIndex = other === tab ? 0 : -1;
        }
        selected(tab);
    };
    list.addEventListener('click', ({ target }) => {
        const tab = (target as Element).closest<HTMLElement>('[role="tab"]');
        if (tab) {
            select(tab);
        }
    });
    list.addEventListener('keydown', (event) => {
        const at = all.indexOf(document.activeElement as HTMLElement);
        const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: all.length - 1 }[event.key];
        const tab = to === undefined || at < 0 ? undefined : all[(to + all.length) % all.length];
        if (tab) {
            event.preventDefault();
            tab.focus();
            select(tab);
        }
    });
    return { select };
}
