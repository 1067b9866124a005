// Caches the page for offline use, and offers new versions.

import { by } from './dom';

export async function keepOffline(): Promise<void> {
    if (!('serviceWorker' in navigator && isSecureContext)) {
        return;
    }
    try {
        const renewed = navigator.serviceWorker.controller !== null;
        const kept = await navigator.serviceWorker.register('service-worker.js', { type: 'classic' });
        if (renewed) {
            tell(kept);
        }
        await navigator.serviceWorker.ready;
        document.documentElement.dataset['offline'] = 'ready';
    } catch {
        // Some private windows have no service workers; the page works without.
    }
}

/** Offers a new version once it is installed, and switches to it on request. */
function tell(kept: ServiceWorkerRegistration): void {
    const show = (next: ServiceWorker | null) => {
        if (!next) {
            return;
        }
        by('update').hidden = false;
        by('take-update').onclick = () => {
            navigator.serviceWorker.addEventListener('controllerchange', () => location.reload());
            next.postMessage('take over');
        };
    };
    show(kept.waiting);
    const watch = (next: ServiceWorker | null) => next?.addEventListener('statechange', () => show(kept.waiting));
    watch(kept.installing);
    kept.addEventListener('updatefound', () => watch(kept.installing));
}
