// Serves the page from a cache, so that it opens offline. Each build has its own cache, named after the digest of its files; unchanged
// files are copied from the previous one. A new build waits until a page asks for it, or the pages of the old one are closed, as they
// may still load chunks.

export {};

declare const self: ServiceWorkerGlobalScope;

/** All files of the page except the scenes, and the digest of their content; inserted by the build. */
declare const FILES: string[];
declare const DIGEST: string;

// Pages in other folders of the same host have caches too.
const PREFIX = `mrfgs ${self.registration.scope} `;
const NAME = PREFIX + DIGEST;

/** Files with a content hash in their name never change. */
const hashed = (url: string) => /-[0-9A-Z]{8}\.\w+$/.test(url);

async function install(): Promise<void> {
    const cache = await caches.open(NAME);
    await Promise.all(
        FILES.map(async (file) => {
            const url = new URL(file, self.registration.scope).href;
            const known = hashed(url) ? await caches.match(url) : undefined;
            // Bypasses the browser's cache, which may hold an older page.
            const answer = known ?? (await fetch(url, { cache: hashed(url) ? 'default' : 'reload' }));
            if (!answer.ok) {
                throw new Error(`${url}: ${answer.status}`);
            }
            await cache.put(url, answer);
        }),
    );
}

async function activate(): Promise<void> {
    const old = (await caches.keys()).filter((name) => name.startsWith(PREFIX) && name !== NAME);
    await Promise.all(old.map((name) => caches.delete(name)));
    await self.clients.claim();
}

async function answer(request: Request): Promise<Response> {
    const cache = await caches.open(NAME);
    const url = new URL(request.url);
    url.search = url.hash = '';
    url.pathname = url.pathname.replace(/index\.html$/, '');
    const known = await cache.match(url.href);
    if (known) {
        return known;
    }
    const fetched = await fetch(request);
    // Scenes are cached when they are opened.
    if (fetched.ok && url.pathname.includes('/scenes/')) {
        await cache.put(url.href, fetched.clone());
    }
    return fetched;
}

self.addEventListener('install', (event) => event.waitUntil(install()));
self.addEventListener('message', ({ data }) => {
    if (data === 'take over') {
        void self.skipWaiting();
    }
});
self.addEventListener('activate', (event) => event.waitUntil(activate()));
self.addEventListener('fetch', (event) => {
    const own = event.request.method === 'GET' && event.request.url.startsWith(self.registration.scope);
    if (own) {
        event.respondWith(answer(event.request));
    }
});
