// The page: connects its parts.

import { followed } from './bar';
import { Broken, Client, Interrupted, explained } from './client';
import { by, count, duration, say, words } from './dom';
import * as legend from './legend';
import { type Pixel, MapView } from './map-view';
import { tooLarge } from './memory';
import { keepOffline } from './offline';
import { painted } from './paint';
import { sharePicture } from './picture';
import { told } from './readout';
import { lit } from './relief';
import type { Cameras, Colours, Comparison, Device, Facts, Known, Map, Pair, Picture, Prior, PriorUse, Range, Result, Size, Warning } from './protocol';
import { Remarks } from './remarks';
import { Ruler } from './ruler';
import { stem } from './save';
import { type File, saveFile } from './saving';
import { Settings } from './settings';
import { offerCamera } from './shots';
import { type Scene, Slots, type View as Opened } from './slots';
import { Wiggle, aligned, anaglyph } from './stereo';
import { SurfaceTab } from './surface';
import { tabs } from './tabs';
import { Turns } from './turns';
import { VideoDialog } from './video';
import { calm, onlyLooks } from './visitor';
import { withoutWebGpu } from './webgpu';

/** Inserted by the build: the worker beside this file, and the scenes. */
declare const WORKER: string;
declare const SCENES: Scene[];

/** Settings of the first match: fast on any machine. */
const FIRST = { device: 'cpu', preset: 'fast' } as const;

/** How long the first map is shown before its surface, in ms. */
const LOOK = 1500;

type View = Map | 'left' | 'stereo' | 'surface';

/** What a pair is rectified by. */
type Rectifier = 'calibration' | 'matches';

/** A pair as read by the engine, and rectified if requested. */
interface Read extends Pair {
    by: Rectifier | undefined;
    /** Notes about the rectification. */
    notes: string[];
    /** Size of the files, before rectification. */
    size: { width: number; height: number };
    /** Contents of the calibration, and the names of its files. */
    cameras: Cameras | undefined;
    range: Range | undefined;
    files: string;
    /** What the engine has of the prior. */
    known: Prior | undefined;
    /** Generation of the worker that holds the pair. */
    generation: number;
}

/** A pair with its name, the prefix of saved files. */
type Loaded = Read & { name: string };

/** State of the page; tests wait for it. */
type State = 'starting' | 'empty' | 'loading' | 'ready' | 'matching' | 'comparing' | 'done' | 'failed';

const app = by('app');
const client = new Client(new URL(WORKER, document.baseURI));
const settings = new Settings(() => void checkRange());
const slots = new Slots(
    SCENES,
    ({ match, rectify: by, same }) => {
        if (!same) {
            rectify = by;
        }
        void load(match);
    },
    (files) => client.call('whole', files),
    (film) => video.open(film),
);
const video = new VideoDialog(client, () => settings.device);
const map = new MapView((pixel) => readOut(pixel), (pixel) => ruler.pick(pixel));
const surface = new SurfaceTab(
    () => result && pair && { ...result, left: pair.left, name: stem(pair.name) },
    () => {
        readOut(undefined);
        ruler.draw();
    },
);
const ruler = new Ruler(
    ({ x, y }) => result?.disparity[y * result.width + x] ?? Infinity,
    () => surface.known,
    () => result,
);
const wiggle = new Wiggle();
const remarks = new Remarks({
    swap: () => void slots.swap(true, turns.signal),
    rectify: () => rectifyBy('matches'),
    widen: (range) => {
        const { signal } = turns;
        settings.give(range);
        void checkRange().then(() => (signal.aborted ? undefined : match()));
    },
    asTheyAre: () => rectifyBy('nothing'),
    atFullSize: () => {
        settings.atFullSize();
        void match();
    },
});
const list = tabs(by('tabs'), (tab) => select(tab.dataset['view'] as View));

let facts: Facts | undefined;
/** Undefined until checked. */
let gpu: boolean | undefined;
let view: View = 'disparity';
let pair: Loaded | undefined;
/** The user's choice of rectification; undefined leaves it to the calibration. `failed` if rectification by matches failed. */
let rectify: Rectifier | 'nothing' | 'failed' | undefined;
/** Likely problems of the pair and the range before a match. */
let suspicions: Warning[] = [];
/** The range used by `automatic`, and its source. */
let found: { range: Range; by: string } | undefined;
let result: (Result & { generation: number; pictures: Partial<Record<Map, Picture>>; on: Device; preset: string; suspicions: Warning[] }) | undefined;
/** The previous map of the same pair. */
let before: { disparity: Float32Array; preset: string } | undefined;
/** The pair and everything that depends on it. */
const turns = new Turns();
/** A check of the range. */
const checks = new Turns();
/** A match that the user can stop. */
const stops = new Turns();

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
const idle = (): State => (result ? 'done' : pair ? 'ready' : facts ? 'empty' : 'starting');

async function start(): Promise<void> {
    be('starting');
    try {
        facts = await client.facts;
        settings.offer(facts.presets);
        document.documentElement.dataset['version'] = facts.version;
        say('version', `Version ${facts.version}`);
    } catch (error) {
        say('problem', `The engine cannot be started: ${words(error)}. It needs a browser with WebAssembly SIMD: Chrome 91, Firefox 89, Safari 16.4 or later.`);
        be('failed');
        return;
    }
    // The first view is a result, unless the user was faster.
    const first = linked() ?? SCENES[0];
    if (first && slots.untouched) {
        await slots.open(first.name);
        await busy;
    }
    slots.illustrate();
    void keepOffline();
    const device = await openGpu();
    gpu = device !== undefined;
    if (!gpu) {
        settings.withoutGpu(withoutWebGpu());
    }
    say('engine', gpu ? `GPU: ${device}` : 'Running on your CPU');
    document.documentElement.dataset['gpu'] = gpu ? 'yes' : 'no';
    if (app.dataset['state'] === 'starting') {
        be(idle());
    }
    await showDepth();
}

/** Takes the settings of the address, and returns its scene. */
function linked(): Scene | undefined {
    const link = new URLSearchParams(location.hash.slice(1));
    settings.take(link);
    return SCENES.find(({ name }) => name === link.get('scene'));
}

/** The name of the GPU; undefined if there is none. Retries if the worker was replaced in the meantime. */
async function openGpu(): Promise<string | undefined> {
    for (;;) {
        try {
            return await client.call('open', 'gpu');
        } catch (error) {
            if (!(error instanceof Interrupted)) {
                return undefined;
            }
        }
    }
}

/** Shows the surface of the first result to a user who has not interacted yet. */
async function showDepth(): Promise<void> {
    await new Promise((resolve) => setTimeout(resolve, LOOK));
    if (onlyLooks() && result && (await surface.prepare()) && onlyLooks() && result) {
        list.select(by('tab-surface'));
    }
}

/** Resolves when the current pair is read, and matched if requested. */
let busy: Promise<void> = Promise.resolve();

function load(match = false): Promise<void> {
    busy = read(match);
    return busy;
}

/** Reads the pair in the slots, if it is complete. */
async function read(matched: boolean): Promise<void> {
    const signal = turns.next();
    app.dataset['turn'] = String(Number(app.dataset['turn'] ?? 0) + 1);
    be('loading');
    forget();
    say('pair-problem', undefined);
    for (const side of ['left', 'right'] as const) {
        slots.problem(side, undefined);
    }
    by('intro').hidden = slots.scene === undefined;
    address();
    const { left, right } = slots.views;
    try {
        await client.cancel();
        signal.throwIfAborted();
        if (left && right) {
            mustFit(left, right);
            pair = await take(signal, left, right);
            if (byHand()) {
                rectify = 'matches';
                pair = await take(signal, left, right);
            }
            remarks.note(pair.notes, pair.by !== undefined);
        }
    } catch (error) {
        if (signal.aborted) {
            return;
        }
        forget();
        refuse(error, left?.name ?? '', right?.name ?? '');
    }
    // A pair of the user's is matched as soon as it can be.
    if (pair && (matched || slots.scene === undefined) && range()) {
        await match(gpu === undefined ? { ...FIRST, preset: settings.chosen ?? FIRST.preset } : settings);
    } else {
        be(idle());
    }
}

/** Reads two views, shows them, and determines the range. */
async function take(signal: AbortSignal, left: Opened, right: Opened): Promise<Loaded> {
    const mine = (pair = { ...(await open(signal, left, right)), name: slots.name ?? left.name });
    surface.pair(mine.left.width, mine.left.height, mine.cameras, mine.files);
    settings.pair(mine.size.width, mine.size.height);
    slots.show('left', mine.left);
    slots.show('right', mine.right);
    void showView();
    await findRange(signal);
    return mine;
}

/** Whether the pair seems to have been taken by hand, and the user has not said how to rectify it. */
function byHand(): boolean {
    const unfound = settings.automatic && !found;
    return rectify === undefined && slots.scene === undefined && slots.calibration.length === 0 && (unfound || suspicions.some(({ remedy }) => remedy === 'rectify'));
}

/** Throws if the views do not form a pair, or are too large, before they are read. */
function mustFit(left: Opened, right: Opened): void {
    const [a, b] = [left.header.size, right.header.size];
    const huge = a && tooLarge(a.width, a.height, left.file.size + right.file.size);
    if (huge) {
        throw new Error(huge);
    }
    if (a && b && (a.width !== b.width || a.height !== b.height)) {
        const [one, other] = [a, b].map(({ width, height }) => `${width} × ${height}`);
        throw new Error(`The left view has ${one} pixels and the right one ${other}. Both images must have the same size.`);
    }
}

/** Reports a problem with a pair, at the slot of the view concerned. */
function refuse(error: unknown, left: string, right: string): void {
    const text = explained(error);
    const about = (name: string) => text.includes(name);
    if (about(left) !== about(right)) {
        slots.problem(about(left) ? 'left' : 'right', text);
    } else {
        say('pair-problem', text);
    }
}

/** Reads the pair with the engine, and rectifies it if requested. */
async function open(signal: AbortSignal, left: Opened, right: Opened): Promise<Read> {
    const call = client.within(signal);
    const { generation } = client;
    const raw = await call('pair', left.file, left.name, right.file, right.name);
    const { width, height } = raw.left;
    const { calibration } = slots;
    const files = calibration.map(({ name }) => name).join(', ');
    const problems: string[] = [];
    // A calibration that cannot be used is reported, and the pair is read without it.
    const tried = async <T>(act: () => Promise<T>): Promise<T | undefined> => {
        try {
            return await act();
        } catch (error) {
            signal.throwIfAborted();
            if (error instanceof Broken || error instanceof Interrupted) {
                throw error;
            }
            problems.push(words(error));
            return undefined;
        }
    };
    const said = calibration.length === 0 ? undefined : await tried<{ known: Known | undefined }>(async () => {
        const found = await call('calibration', calibration, width, height);
        const size = found?.size;
        if (size && (size.width !== width || size.height !== height)) {
            throw new Error(`${files} is for images of ${size.width} × ${size.height}, and these are ${width} × ${height}: it is not used.`);
        }
        return { known: found };
    });
    const known = said?.known;
    const wanted = rectify ?? (said && !known ? 'calibration' : 'nothing');
    const by = wanted === 'calibration' || wanted === 'matches' ? wanted : undefined;
    const rectified = by && (await tried(() => call('rectify', by === 'calibration' ? calibration : undefined)));
    if (by === 'matches' && !rectified) {
        rectify = 'failed';
    }
    const { prior } = slots;
    const given = prior && (await tried(() => call('know', prior.file, prior.name)));
    if (prior && !given) {
        slots.cannotUse(prior);
    }
    sayPrior(given, undefined);
    say('pair-problem', problems.join(' '));
    const read = { files, size: { width, height }, known: given, generation };
    return rectified
        ? { ...rectified, ...read, by, range: undefined }
        : { ...raw, ...read, by: undefined, notes: known?.notes ?? [], cameras: known?.cameras, range: known?.range };
}

/** Tells what is known, and once it was used how much of it was dropped. */
function sayPrior(known: Prior | undefined, used: PriorUse | undefined): void {
    if (!known) {
        say('prior-note', undefined);
        return;
    }
    const { kind, given } = known;
    const what = `${kind === 'points' ? 'point' : 'pixel'}${given === 1 ? '' : 's'}`;
    const dropped = kind === 'points' && used ? `, ${count(used.dropped)} dropped` : '';
    say('prior-note', `${slots.prior?.name}: ${count(given)} ${what} known beforehand${dropped}`);
}

/** Changes the rectification of the pair, and matches it. */
function rectifyBy(by: Rectifier | 'nothing'): void {
    rectify = by;
    void load(true);
}

/** Determines the range for `automatic`. */
async function findRange(signal: AbortSignal): Promise<void> {
    if (pair?.range) {
        found = { range: pair.range, by: pair.files };
    } else {
        say('range-found', 'Looking for the range …');
        const range = await client.within(signal)('range');
        found = range && { range, by: MATCHES };
    }
    if (found && settings.automatic) {
        settings.suggest(found.range);
    }
    await checkRange();
    signal.throwIfAborted();
}

/** The range to search. */
function range(): Range | undefined {
    return settings.automatic ? found?.range : settings.given;
}

/** Shows the range to be searched, and its likely problems. */
async function checkRange(): Promise<void> {
    const wanted = range();
    const { automatic } = settings;
    const signal = checks.next(turns.signal);
    say('range-found', pair && found && automatic ? `${found.range.min} to ${found.range.max} px, by ${found.by}` : undefined);
    const unfound = pair !== undefined && automatic && !wanted;
    by('no-range').hidden = !unfound || pair?.by !== undefined || rectify === 'failed';
    if (!automatic && !wanted) {
        say('range-problem', 'Give two whole numbers, the smaller one first.');
        return;
    }
    say('range-problem', unfound ? 'No depth range was found. Do both images show the same scene? If so, give a range.' : undefined);
    // A new worker has no pair before the next match.
    if (!pair || pair.generation !== client.generation) {
        return;
    }
    try {
        // Only a range from the user is informative.
        suspicions = await client.within(signal)('warnings', automatic && found?.by === MATCHES ? undefined : wanted);
    } catch (error) {
        if (signal.aborted) {
            return;
        }
        suspicions = [];
        say('range-problem', words(error));
    }
    // The warnings of a result remain with it.
    if (!result) {
        warn(suspicions);
    }
}

/** Shows warnings. A remedy that has failed is not offered again. */
function warn(warnings: Warning[]): void {
    remarks.warn(warnings.map((warning) => (rectify === 'failed' && warning.remedy === 'rectify' ? { ...warning, remedy: undefined } : warning)));
}

/** Source of a range that no file gives. */
const MATCHES = 'sparse matches';

/** Resolves when no match is running. */
let running: Promise<void> | undefined;

/** Runs a match exclusively, after ending the previous one. */
async function alone(signal: AbortSignal, act: () => Promise<void>): Promise<void> {
    while (running) {
        void client.cancel();
        await running;
    }
    if (!signal.aborted) {
        running = act().finally(() => (running = undefined));
        await running;
    }
}

/** Runs a match with its progress bar; undefined if it was stopped or failed, which is reported. */
async function run<T>(signal: AbortSignal, state: State, match: () => Promise<T>): Promise<T | undefined> {
    say('problem', undefined);
    client.onProgress = followed();
    // Focus moves to the button that replaces the pressed one, but only if the user pressed it.
    const pressed = document.activeElement === by(state === 'comparing' ? 'compare' : 'match');
    be(state);
    if (pressed) {
        by('cancel').focus();
    }
    const begun = performance.now();
    try {
        const value = await match();
        app.dataset['took'] = String(performance.now() - begun);
        say('announce', undefined);
        return value;
    } catch (error) {
        if (!signal.aborted) {
            say('problem', error instanceof Interrupted ? 'Stopped.' : explained(error));
        }
        return undefined;
    } finally {
        if (document.activeElement === by('cancel') || (pressed && document.activeElement === document.body)) {
            queueMicrotask(() => by('match').focus());
        }
    }
}

/** Reads the pair again if the worker was replaced. */
async function ensurePair(signal: AbortSignal): Promise<void> {
    const { left, right } = slots.views;
    if (pair && left && right && pair.generation !== client.generation) {
        pair = { ...pair, ...(await open(signal, left, right)) };
    }
}

async function match({ device, preset, size }: { device: Device; preset: string; size?: Size } = settings): Promise<void> {
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
    if (!pair) {
        // An earlier attempt to read it failed; retries.
        void load(true);
        return;
    }
    const wanted = range();
    if (!wanted) {
        await checkRange();
        by(!settings.automatic ? 'min' : by('no-range').hidden ? 'preset' : 'rectify').focus();
        return;
    }
    const { signal } = turns;
    await alone(signal, async () => {
        const was = suspicions;
        const wide = settings.automatic && found?.by === MATCHES;
        const matched = await run(signal, 'matching', async () => {
            const stop = stops.next();
            await ensurePair(signal);
            await client.facts;
            if (stop.aborted) {
                throw new Interrupted('interrupted');
            }
            return client.within(signal)('match', device, preset, wanted, wide, size ?? 'automatic', colours());
        });
        if (matched) {
            const pictures = { disparity: matched.picture };
            before = result && { disparity: result.disparity, preset: result.preset };
            result = { ...matched, generation: client.generation, pictures, on: device, preset, suspicions: was };
            await present();
        }
        if (signal.aborted) {
            return;
        }
        // On a narrow page the result is above the form.
        if (matched && gpu !== undefined) {
            by('result').scrollIntoView({ block: 'nearest', behavior: calm() ? 'instant' : 'smooth' });
        }
        be(idle());
    });
}

/** Puts scene and settings into the URL, so that it can be shared. */
function address(): void {
    const { chosen, automatic, given } = settings;
    const parts = { ...(slots.scene && { scene: slots.scene }), ...(chosen && { preset: chosen }), ...(!automatic && given && { range: `${given.min},${given.max}` }) };
    const hash = slots.scene && gpu !== undefined ? `#${new URLSearchParams(parts)}` : slots.scene ? location.hash : '';
    history.replaceState(null, '', `${location.pathname}${location.search}${hash}`);
}

/** Shows the result. */
async function present(): Promise<void> {
    if (!result) {
        return;
    }
    const { width, height, warnings, device, iterations, took, preset, corrected, tiles, half, short } = result;
    const { min, max } = result.range;
    const failed = result.note === undefined ? [] : [{ text: result.note, remedy: undefined }];
    warn([...failed, ...result.suspicions, ...warnings]);
    const notes = [...(pair?.notes ?? []), ...(corrected ? [corrected] : []), ...(tiles > 1 ? [`matched in ${tiles} tiles`] : [])];
    remarks.note(notes, pair?.by !== undefined, short);
    by('outcome').hidden = false;
    sayPrior(pair?.known, result.prior);
    address();
    say('comparison', undefined);
    say('save-problem', undefined);
    const facts = [`${width} × ${height} pixels`, ...(half ? ['at half size'] : []), `range ${min} to ${max}`, preset, `${iterations} iterations`, device, duration(took)];
    say('facts', facts.join(' · '));
    by('compare').title = gpu ? 'Matches by the other path too and counts the pixels that differ' : 'There is no GPU to compare with';
    surface.result(true);
    offerBefore();
    ruler.clear();
    readOut(undefined);
    await showView();
}

/** Offers the previous map behind the divider. */
function offerBefore(): void {
    const behind = by<HTMLSelectElement>('behind');
    const option = behind.querySelector('[value="before"]') as HTMLOptionElement;
    option.disabled = !before;
    option.textContent = before ? `Map before (${before.preset})` : 'Map before';
    if (!before) {
        behind.value = 'left';
    }
}

/** The picture to the left of the divider. */
function behind(left: Picture): Picture {
    if (!before || !result || !facts || by<HTMLSelectElement>('behind').value === 'left') {
        return left;
    }
    return painted(result.width, result.height, before.disparity, facts.scales[colours()], result.spread);
}

/** A changed pair clears all messages and results. */
function forget(): void {
    pair = found = result = before = undefined;
    suspicions = [];
    map.clear();
    wiggle.stop();
    remarks.clear();
    by('no-range').hidden = true;
    offerBefore();
    ruler.clear();
    legend.none();
    surface.forget();
    by('outcome').hidden = true;
    for (const id of ['facts', 'comparison', 'readout', 'prior-note', 'problem', 'range-found', 'range-problem', 'save-problem', 'stage']) {
        say(id, undefined);
    }
    by('map').dataset['shown'] = '';
}

const colours = (): Colours => by<HTMLSelectElement>('colours').value as Colours;

/** Whether the worker still holds the result; a replaced worker does not. */
function held(): boolean {
    return result !== undefined && result.generation === client.generation;
}

async function picture(of: Map): Promise<Picture | undefined> {
    const mine = result;
    if (mine && !mine.pictures[of]) {
        // Confidence is not a distance, so it has its own colours.
        mine.pictures[of] = await client.call('picture', of, of === 'confidence' ? 'grey' : colours());
    }
    return mine?.pictures[of];
}

async function showView(): Promise<void> {
    const mine = result;
    const shown = view;
    wiggle.stop();
    if (!pair || shown === 'surface') {
        return;
    }
    if (!mine) {
        // Shows the views until there is a map.
        map.show(pair.left, pair.left);
        readOut(undefined);
        return;
    }
    try {
        const seen = shown === 'left' || shown === 'stereo' ? pair.left : await picture(shown);
        if (!seen || mine !== result || shown !== view) {
            return;
        }
        if (shown === 'stereo') {
            showStereo(pair, mine.spread);
        } else {
            const relief = shown === 'disparity' && by<HTMLInputElement>('relief').checked;
            map.show(relief ? lit(seen, mine.disparity, mine.spread) : seen, shown === 'left' ? seen : behind(pair.left));
        }
    } catch (error) {
        if (mine === result) {
            say('readout', words(error));
        }
        return;
    }
    if (shown === 'disparity' && facts) {
        legend.scale(facts.scales[colours()], pixels(mine.spread.min), pixels(mine.spread.max), 'px of disparity', '98 % of the measured pixels are between these');
    } else if (shown === 'confidence' && facts) {
        legend.scale(facts.scales.grey, '0', '255', 'how sure each pixel is');
    } else if (shown === 'validity' && facts) {
        legend.reasons(facts.reasons, mine.validity);
    } else {
        legend.none();
    }
    by('map').dataset['shown'] = shown;
}

/** Shows both views, aligned at the middle of the disparity range. */
function showStereo({ left, right }: Pair, { min, max }: Range): void {
    const moved = aligned(right, (min + max) / 2);
    if (by<HTMLSelectElement>('stereo').value === 'anaglyph') {
        const both = anaglyph(left, moved);
        map.show(both, both);
    } else {
        map.show(left, left);
        wiggle.start([left, moved], (picture) => map.redraw(picture));
    }
}

/** A disparity with the digits of a legend. */
const pixels = (value: number): string => String(Number(value.toFixed(1)));

function select(to: View): void {
    view = to;
    const inSurface = to === 'surface';
    by('map').hidden = by('map-tools').hidden = inSurface;
    by('surface').hidden = by('surface-tools').hidden = !inSurface;
    by('colours-label').hidden = by('relief-label').hidden = to !== 'disparity';
    by('stereo-label').hidden = to !== 'stereo';
    by('map').setAttribute('aria-labelledby', `tab-${inSurface ? 'disparity' : to}`);
    surface.select(inSurface, result !== undefined);
    void showView();
}

/** Shows the values of a pixel. */
function readOut(pixel: Pixel | undefined): void {
    if (!result || !facts || !pixel) {
        const hint = result ? 'Point at a pixel to read its disparity.' : 'The left view. Match the pair to see its maps.';
        say('readout', pair && hint);
        return;
    }
    say('readout', told(pixel, result, facts, surface.known));
}

/** Matches on the other device and compares. */
async function compare(): Promise<void> {
    const { signal } = turns;
    await alone(signal, async () => {
        const mine = result;
        if (!mine) {
            return;
        }
        say('comparison', undefined);
        const comparison = await run<Comparison>(signal, 'comparing', async () => {
            if (!held()) {
                throw new Error('The engine was started again since this match. Match once more to compare.');
            }
            return client.within(signal)('compare', mine.on === 'gpu' ? 'cpu' : 'gpu');
        });
        if (signal.aborted) {
            return;
        }
        if (comparison) {
            const failed = mine.note ?? comparison.note;
            const differ = `${count(comparison.differing)} of ${count(mine.width * mine.height)} pixels differ`;
            say('comparison', failed ? `No comparison: the GPU did not do it. ${failed}` : `${differ} (${comparison.device}: ${duration(comparison.took)})`);
        }
        be(idle());
    });
}

async function download(file: File | 'picture'): Promise<void> {
    const [mine, of] = [result, pair];
    say('save-problem', undefined);
    try {
        if (file === 'picture') {
            await sharePicture(stem(of?.name ?? ''));
            return;
        }
        if (!held() || !mine || !of) {
            throw new Error('The engine was started again since this match. Match once more to save.');
        }
        await saveFile(client, file, stem(of.name), mine, of.left, surface.cameras, surface.leastConfidence);
    } catch (error) {
        if (mine === result) {
            say('save-problem', explained(error));
        }
    }
}

by('close-device-note').addEventListener('click', () => (by('device-note').hidden = true));
by('form').addEventListener('submit', (event) => {
    event.preventDefault();
    void match();
});
by('cancel').addEventListener('click', () => {
    say('stage', 'stopping');
    stops.next();
    void client.cancel();
});
by('rectify').addEventListener('click', () => rectifyBy('matches'));
by('compare').addEventListener('click', () => void compare());
by('downloads').addEventListener('click', ({ target }) => {
    const file = (target as HTMLElement).dataset['output'] as File | 'picture' | undefined;
    if (file) {
        void download(file);
    }
});
by('colours').addEventListener('change', () => {
    if (result) {
        delete result.pictures.disparity;
        void showView();
    }
});
for (const id of ['relief', 'stereo', 'behind']) {
    by(id).addEventListener('change', () => void showView());
}
offerCamera((views) => {
    void slots.take(views, { name: 'camera', wish: { match: true, rectify: 'matches' } });
});
// The user has edited the address, or followed a link to another scene.
addEventListener('hashchange', () => {
    const scene = linked();
    if (scene) {
        void slots.open(scene.name);
    }
});
list.select(by('tab-disparity'));
void start();
