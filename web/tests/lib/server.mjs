// A static host of the built page, in a sub-folder as on GitHub Pages. It can be stopped while a page is open.
import { createReadStream, readFileSync, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { basename, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const TYPES = {
    '.css': 'text/css; charset=utf-8',
    '.html': 'text/html; charset=utf-8',
    '.js': 'text/javascript; charset=utf-8',
    '.mjs': 'text/javascript; charset=utf-8',
    '.png': 'image/png',
    '.svg': 'image/svg+xml',
    '.txt': 'text/plain; charset=utf-8',
    '.wasm': 'application/wasm',
};

/**
 * Serves folders below these prefixes: `{ '/mrfgs/': 'target/web/site' }`; a function instead of a folder handles requests.
 * `replace` edits the text of all files with this name.
 * @returns {Promise<{ url: string, asked: string[], replace(name: string, edit: (text: string) => string): void, stop(): Promise<void> }>}
 */
export async function serve(mounts, port = 0) {
    const asked = [];
    const edits = new Map();
    const server = createServer((request, response) => {
        const { pathname } = new URL(request.url, 'http://localhost');
        asked.push(pathname);
        const prefix = Object.keys(mounts).find((mount) => pathname.startsWith(mount));
        const mount = prefix && mounts[prefix];
        if (typeof mount === 'function') {
            mount(request, response, pathname.slice(prefix.length));
            return;
        }
        const inside = mount && normalize(decodeURIComponent(pathname.slice(prefix.length)) || 'index.html');
        const file = inside && !inside.startsWith('..') && join(mount, inside.endsWith('/') ? `${inside}index.html` : inside);
        if (!file || !statSync(file, { throwIfNoEntry: false })?.isFile()) {
            response.writeHead(404).end();
            return;
        }
        response.writeHead(200, { 'content-type': TYPES[extname(file)] ?? 'application/octet-stream' });
        const edit = edits.get(basename(file));
        if (edit) {
            response.end(edit(readFileSync(file, 'utf8')));
            return;
        }
        createReadStream(file).pipe(response);
    });
    await new Promise((resolve, reject) => {
        server.once('error', reject);
        server.listen(port, '127.0.0.1', resolve);
    });
    return {
        url: `http://127.0.0.1:${server.address().port}`,
        asked,
        replace: (name, edit) => edits.set(name, edit),
        stop: () => {
            server.closeAllConnections();
            return new Promise((resolve) => server.close(resolve));
        },
    };
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
    const port = Number(process.argv[3] ?? 8000);
    try {
        const { url } = await serve({ '/': process.argv[2] }, port);
        console.log(`The page is at ${url}/ until Ctrl-C.`);
    } catch (error) {
        const taken = error.code === 'EADDRINUSE';
        console.error(`The page cannot be served on port ${port}: ${taken ? 'something else uses it. Give another one: scripts/web --serve 8001' : error.message}`);
        process.exit(1);
    }
}
