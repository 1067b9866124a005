// The page: what follows what.

import { Broken, Client, Interrupted } from './client';
import { by, count, duration, make, say, words } from './dom';
import * as legend from './legend';
import { type Pixel, MapView } from './map-view';
import { tooLarge } from './memory';
import { keepOffline } from './offline';
import { PointsTab } from './points';
import type { Colours, Comparison, Device, Facts, Map, Output, Pair, Picture, Range, Result } from './protocol';
import { save, stem } from './save';
import { Settings } from './settings';
import { type Scene, Slots } from './slots';
import { tabs } from './tabs';
import { withoutWebGpu } from './webgpu';

/** Filled in by the build: the worker beside this file, and the scenes. */
declare const WORKER: string;
declare const SCENES: Scene[];

type View = Map | 'left' | 'points';

/** What the page is at; tests wait for it too. */
type State = 'starting' | 'empty' | 'loading' | 'ready' | 'matching' | 'comparing' | 'done' | 'failed';

const app = by('app');
const client = new Client(new URL(WORKER, document.baseURI));
const settings = new Settings(() => void checkRange());
const slots = new Slots(SCENES, () => void load());
const map = new MapView((pixel) => readOut(pixel));
const points = new PointsTab((cameras) => client.call('points', cameras), () => readOut(undefined));
const list = tabs(by('tabs'), (tab) => select(tab.dataset['view'] as View));

let facts: Facts | undefined;
let gpu = true;
let view: View = 'disparity';
let pair: (Pair & { generation: number }) | undefined;
/** The range that `automatic` stands for, and where it comes from. */
let found: { range: Range; by: string } | undefined;
let result: (Result & { generation: number; pictures: Partial<Record<Map, Picture>>; on: Device; preset: string }) | undefined;
/** Grows when the pair changes: what was asked for an earlier one is not wanted any more. */
let turn = 0;

function be(state: State): void {
    app.dataset['state'] = state;
    const busy = state === 'matching' || state === 'comparing';
    by('running').hidden = !busy;
    by<HTMLButtonElement>('match').disabled = busy || state === 'starting' || state === 'loading' || !facts;
    by<HTMLButtonElement>('compare').disabled = busy || !result || !gpu;
    for (const button of by('downloads').querySelectorAll('button')) {
        button.disabled = busy;
    }
}

/** The state between calls. */
const idle = (): State => (result ? 'done' : pair ? 'ready' : 'empty');

async function start(): Promise<void> {
    be('starting');
    try {
        facts = await client.facts;
        settings.offer(facts.presets);
        document.documentElement.dataset['version'] = facts.version;
    } catch (error) {
        say('problem', `The engine cannot be started: ${words(error)}. It needs a browser with WebAssembly SIMD: Chrome 91, Firefox 89, Safari 16.4 or later.`);
        be('failed');
        return;
    }
    try {
        say('engine', `GPU: ${await client.call('open', 'gpu')}`);
    } catch {
        gpu = false;
        settings.withoutGpu(withoutWebGpu());
        say('engine', 'No WebGPU: the CPU path');
    }
    document.documentElement.dataset['gpu'] = gpu ? 'yes' : 'no';
    if (app.dataset['state'] === 'starting') {
        be(idle());
    }
}

/** Reads the pair that the slots hold, as far as they do. */
async function load(): Promise<void> {
    const mine = ++turn;
    const current = () => mine === turn;
    app.dataset['turn'] = String(turn);
    be('loading');
    await client.cancel();
    if (!current()) {
        return;
    }
    pair = found = undefined;
    forget();
    say('problem', undefined);
    say('range-found', undefined);
    warn([]);
    const { left, right } = slots.views;
    if (!left || !right) {
        be(facts ? 'empty' : 'starting');
        return;
    }
    for (const side of ['left', 'right'] as const) {
        slots.problem(side, undefined);
    }
    try {
        const [a, b] = [left.header.size, right.header.size];
        const huge = a && tooLarge(a.width, a.height, left.file.size + right.file.size);
        if (huge) {
            throw new Error(huge);
        }
        if (a && b && (a.width !== b.width || a.height !== b.height)) {
            const [one, other] = [a, b].map(({ width, height }) => `${width} × ${height}`);
            throw new Error(`The left view has ${one} pixels and the right one ${other}. A rectified pair has views of one size.`);
        }
        const read = await client.call('pair', left.file, left.name, right.file, right.name);
        if (!current()) {
            return;
        }
        pair = { ...read, generation: client.generation };
        slots.show('left', read.left);
        slots.show('right', read.right);
        void showView();
        await calibrate(read.left);
        await findRange(current);
        if (current()) {
            be('ready');
        }
    } catch (error) {
        if (current()) {
            pair = undefined;
            refuse(error, left.name, right.name);
            be(facts ? 'empty' : 'starting');
        }
    }
}

/** Says what is wrong with a pair, at the slot of the view that it is about. */
function refuse(error: unknown, left: string, right: string): void {
    const text = explained(error);
    const about = (name: string) => text.includes(name);
    if (about(left) !== about(right)) {
        slots.problem(about(left) ? 'left' : 'right', text);
    } else {
        say('pair-problem', text);
    }
}

function explained(error: unknown): string {
    const memory = /memory|allocation|unreachable|out of bounds/i.test(words(error));
    return error instanceof Broken
        ? `The engine ended (${words(error)}) and was started again. ${memory ? 'It ran out of memory, most likely: try smaller views or a smaller range.' : ''}`.trim()
        : words(error);
}

/** Takes the cameras of a calib.txt, or a guess. */
async function calibrate({ width, height }: Picture): Promise<void> {
    const file = slots.calibration;
    let cameras;
    if (file) {
        try {
            if (file.size && (file.size.width !== width || file.size.height !== height)) {
                throw new Error(`calib.txt is for images of ${file.size.width} × ${file.size.height}, and these are ${width} × ${height}: it is not used.`);
            }
            found = file.range && { range: file.range, by: 'calib.txt' };
            cameras = file.cameras ? await client.call('cameras', file.text) : undefined;
        } catch (error) {
            say('pair-problem', words(error));
        }
    }
    points.pair(width, height, cameras);
}

async function findRange(current: () => boolean): Promise<void> {
    if (!found) {
        say('range-found', 'Looking for the range …');
        const range = await client.call('range');
        found = range && { range, by: 'sparse matches' };
    }
    if (current()) {
        if (found && settings.automatic) {
            settings.suggest(found.range);
        }
        await checkRange();
    }
}

/** The range to search, which is said beside its choice. */
function range(): Range | undefined {
    return settings.automatic ? found?.range : settings.given;
}

/** Says which range it will be, and what is probably wrong with it. */
async function checkRange(): Promise<void> {
    const wanted = range();
    const { automatic } = settings;
    say('range-found', pair && found && automatic ? `${found.range.min} to ${found.range.max} px, by ${found.by}` : undefined);
    if (!automatic && !wanted) {
        say('range-problem', 'Give two whole numbers, the smaller one first.');
        return;
    }
    say('range-problem', pair && !wanted ? 'Sparse matches find no range. Give one.' : undefined);
    if (pair) {
        try {
            warn(await client.call('warnings', wanted));
        } catch (error) {
            say('range-problem', words(error));
        }
    }
}

function warn(texts: string[]): void {
    by('warnings').replaceChildren(...[...new Set(texts)].map((text) => make('li', {}, text)));
}

/** Runs a match with its bar; undefined when it was stopped or failed, which is said. */
async function run<T>(state: State, match: () => Promise<T>): Promise<T | undefined> {
    const mine = turn;
    const bar = by<HTMLProgressElement>('progress');
    let said = 0;
    bar.value = 0;
    say('stage', 'starting');
    say('problem', undefined);
    client.onProgress = (stage, done) => {
        bar.value = done;
        bar.setAttribute('aria-valuetext', `${Math.round(100 * done)} percent, ${stage}`);
        say('stage', `${Math.floor(100 * done)} %, ${stage}`);
        if (done >= said + 0.25) {
            said = Math.floor(4 * done) / 4;
            say('announce', `${100 * said} percent`);
        }
    };
    be(state);
    by('cancel').focus();
    const begun = performance.now();
    try {
        const value = await match();
        app.dataset['took'] = String(performance.now() - begun);
        say('announce', undefined);
        return value;
    } catch (error) {
        if (mine === turn) {
            say('problem', error instanceof Interrupted ? 'Stopped.' : explained(error));
        }
        return undefined;
    } finally {
        if (document.activeElement === by('cancel') || document.activeElement === document.body) {
            queueMicrotask(() => by('match').focus());
        }
    }
}

/** The worker's pair, read again where the worker is a new one. */
async function ensurePair(): Promise<void> {
    const { left, right } = slots.views;
    if (pair && left && right && pair.generation !== client.generation) {
        const generation = client.generation;
        await client.call('pair', left.file, left.name, right.file, right.name);
        pair.generation = generation;
    }
}

async function match(): Promise<void> {
    const missing = slots.missing;
    if (missing) {
        for (const side of ['left', 'right'] as const) {
            if (!slots.views[side]) {
                slots.askFor(side);
            }
        }
        by(`${missing}-file`).focus();
        return;
    }
    const wanted = range();
    if (!pair || !wanted) {
        if (pair) {
            await checkRange();
            by(settings.automatic ? 'preset' : 'min').focus();
        }
        return;
    }
    const mine = turn;
    const { device, preset } = settings;
    forget();
    const matched = await run('matching', async () => {
        await ensurePair();
        return client.call('match', device, preset, wanted, colours());
    });
    if (mine !== turn) {
        return;
    }
    if (matched) {
        const pictures = { disparity: matched.picture };
        result = { ...matched, generation: client.generation, pictures, on: device, preset };
        await present();
    }
    be(idle());
}

/** Shows the result. */
async function present(): Promise<void> {
    if (!result) {
        return;
    }
    const { width, height, note, warnings, device, iterations, took, preset } = result;
    const { min, max } = result.range;
    warn([...(note ? [note] : []), ...warnings]);
    by('outcome').hidden = false;
    say('comparison', undefined);
    const facts = [`${width} × ${height} pixels`, `range ${min} to ${max}`, preset, `${iterations} iterations`, device, duration(took)];
    say('facts', facts.join(' · '));
    by('compare').title = gpu ? 'Matches by the other path too and counts the pixels that differ' : 'There is no GPU to compare with';
    points.result(true);
    readOut(undefined);
    await showView();
    // On a narrow page the result is below the form.
    const calm = matchMedia('(prefers-reduced-motion: reduce)').matches;
    by('result').scrollIntoView({ block: 'nearest', behavior: calm ? 'instant' : 'smooth' });
}

/** A pair that changes takes its result along. */
function forget(): void {
    result = undefined;
    if (!pair) {
        map.clear();
    }
    legend.none();
    points.result(false);
    by('outcome').hidden = true;
    for (const id of ['facts', 'comparison', 'readout', 'save-problem', 'stage']) {
        say(id, undefined);
    }
    by('map').dataset['shown'] = '';
    void showView();
}

const colours = (): Colours => by<HTMLSelectElement>('colours').value as Colours;

/** What the worker holds is gone once it was replaced. */
function held(): boolean {
    return result !== undefined && result.generation === client.generation;
}

async function picture(of: Map): Promise<Picture | undefined> {
    const mine = result;
    if (mine && !mine.pictures[of]) {
        // Confidence is no distance: it has a scale of its own.
        mine.pictures[of] = await client.call('picture', of, of === 'confidence' ? 'grey' : colours());
    }
    return mine?.pictures[of];
}

async function showView(): Promise<void> {
    const mine = result;
    const shown = view;
    if (!pair || shown === 'points') {
        return;
    }
    if (!mine) {
        // What there is to see before there is a map.
        map.show(pair.left, pair.left);
        readOut(undefined);
        return;
    }
    try {
        const seen = shown === 'left' ? pair.left : await picture(shown);
        if (!seen || mine !== result || shown !== view) {
            return;
        }
        map.show(seen, pair.left);
    } catch (error) {
        say('readout', words(error));
        return;
    }
    if (shown === 'disparity' && facts) {
        legend.scale(facts.scales[colours()], String(mine.range.min), String(mine.range.max), 'px');
    } else if (shown === 'confidence' && facts) {
        legend.scale(facts.scales.grey, '0', '255', 'in 1/8 nat: how far the runner-up is behind, on average over the pixels around');
    } else if (shown === 'validity' && facts) {
        legend.reasons(facts.reasons, mine.validity);
    } else {
        legend.none();
    }
    by('map').dataset['shown'] = shown;
}

function select(to: View): void {
    view = to;
    const inPoints = to === 'points';
    by('map').hidden = by('map-tools').hidden = inPoints;
    by('points').hidden = by('points-tools').hidden = !inPoints;
    by('colours-label').hidden = to !== 'disparity';
    by('map').setAttribute('aria-labelledby', `tab-${inPoints ? 'disparity' : to}`);
    points.select(inPoints, result !== undefined);
    void showView();
}

/** Says what is known of a pixel. */
function readOut(pixel: Pixel | undefined): void {
    if (!result || !facts || !pixel) {
        const hint = result ? 'Point at a pixel to read its disparity.' : 'The left view. Match the pair to see its maps.';
        say('readout', pair && hint);
        return;
    }
    const at = pixel.y * result.width + pixel.x;
    const [disparity, confidence, validity] = [result.disparity[at] ?? Infinity, result.confidence[at] ?? 0, result.validity[at] ?? 0];
    const measured = Number.isFinite(disparity);
    const parts = [
        `x ${pixel.x}, y ${pixel.y}`,
        measured ? `disparity ${disparity.toFixed(2)} px` : 'no disparity',
        `confidence ${confidence}`,
        legend.named(facts.reasons, validity).map(({ name }) => name).join(', '),
    ];
    const cameras = points.known;
    const apart = cameras && measured ? disparity + cameras.doffs : 0;
    if (cameras && apart > 0) {
        const unit = cameras.unit === 'unknown' ? '' : ` ${cameras.unit}`;
        parts.push(`depth ${((cameras.baseline * cameras.focalLength) / apart).toPrecision(5)}${unit}`);
    }
    say('readout', parts.join(' · '));
}

/** Matches by the other path too. */
async function compare(): Promise<void> {
    const mine = result;
    if (!mine) {
        return;
    }
    const path = mine.on === 'gpu' ? 'cpu' : 'gpu';
    say('comparison', undefined);
    const comparison = await run<Comparison>('comparing', async () => {
        if (!held()) {
            throw new Error('The engine was started again since this match. Match once more to compare.');
        }
        return client.call('compare', path);
    });
    if (mine !== result) {
        return;
    }
    if (comparison) {
        const failed = mine.note ?? comparison.note;
        const differ = `${count(comparison.differing)} of ${count(mine.width * mine.height)} pixels differ`;
        say('comparison', failed ? `No comparison: the GPU did not do it. ${failed}` : `${differ} (${comparison.device}: ${duration(comparison.took)})`);
    }
    be(idle());
}

async function download(output: Output | 'ply'): Promise<void> {
    const name = slots.scene ?? stem(slots.views.left?.name ?? 'pair');
    say('save-problem', undefined);
    try {
        if (!held()) {
            throw new Error('The engine was started again since this match. Match once more to save.');
        }
        if (output === 'ply') {
            const cameras = points.cameras;
            if (!cameras) {
                throw new Error('The points take the cameras, in the tab Points.');
            }
            save(await client.call('ply', cameras, points.leastConfidence), `${name}-points.ply`, 'application/octet-stream');
        } else {
            const of = output === 'pfm' || output === 'png' ? 'disparity' : output;
            const png = output !== 'pfm' && output !== 'raw';
            const type = png ? 'image/png' : 'application/octet-stream';
            save(await client.call('file', output), `${name}-${of}.${png ? 'png' : 'pfm'}`, type);
        }
    } catch (error) {
        say('save-problem', explained(error));
    }
}

by('form').addEventListener('submit', (event) => {
    event.preventDefault();
    void match();
});
by('cancel').addEventListener('click', () => {
    say('stage', 'stopping');
    void client.cancel();
});
by('compare').addEventListener('click', () => void compare());
by('downloads').addEventListener('click', ({ target }) => {
    const output = (target as HTMLElement).dataset['output'] as Output | 'ply' | undefined;
    if (output) {
        void download(output);
    }
});
by('colours').addEventListener('change', () => {
    if (result) {
        delete result.pictures.disparity;
        void showView();
    }
});
list.select(by('tab-disparity'));
void start();
void keepOffline();
