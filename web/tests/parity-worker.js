// The engine in a worker, for parity.mjs: matches a pair from the host and posts the files back.
import init, * as engine from '/engine/mrfgs_web.js';

const ready = init({ module_or_path: new URL('/engine/mrfgs_web_bg.wasm', self.location.href) });
const matchers = new Map();
const get = async (path) => new Uint8Array(await (await fetch(path)).arrayBuffer());

async function match({ path, preset, pair: number, range: { min, max } }) {
    await ready;
    const files = await Promise.all(['im0.png', 'im1.png'].map((file) => get(`/pairs/${number}/${file}`)));
    const pair = new engine.StereoPair(files[0], 'im0.png', files[1], 'im1.png');
    const range = new engine.Range(min, max);
    const matcher = matchers.get(path) ?? (await engine.Matcher.open(path));
    matchers.set(path, matcher);
    const begun = performance.now();
    const found = await matcher.match(pair, preset, range, () => true);
    const seconds = (performance.now() - begun) / 1000;
    const outputs = { pfm: found.pfm('disparity'), raw: found.pfm('raw'), confidence: found.png('confidence'), validity: found.png('validity') };
    for (const [name, body] of Object.entries(outputs)) {
        await fetch(`/results/${name}`, { method: 'POST', body });
    }
    const { width, height, device, note } = found;
    for (const object of [found, range, pair]) {
        object.free();
    }
    return { width, height, device, note, seconds };
}

self.onmessage = async ({ data }) => {
    let answer;
    try {
        answer = await match(data);
    } catch (error) {
        answer = { error: error.message ?? String(error) };
    }
    self.postMessage(answer);
};
