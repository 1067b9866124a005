// Keeps the page for use without a network.

export async function keepOffline(): Promise<void> {
    if ('serviceWorker' in navigator && isSecureContext) {
        try {
            await navigator.serviceWorker.register('service-worker.js', { type: 'classic' });
            await navigator.serviceWorker.ready;
            document.documentElement.dataset['offline'] = 'ready';
        } catch {
            // Some private windows have none; the page works without.
        }
    }
}
