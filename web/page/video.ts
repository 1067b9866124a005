// Matches a film or cameras live: the left view, and its depth beside it.

import { Broken, type Client, Interrupted, explained } from './client';
import { by, make, say, words } from './dom';
import { Recording, canRecord } from './film';
import { Frames } from './frames';
import type { Device, Live } from './protocol';
import { share, stem } from './save';
import { Turns } from './turns';

/** Widths that can be chosen, and the usual one of each device, in pixels. */
const WIDTHS = [320, 480, 640, 960, 1280];
const USUAL = { cpu: 480, gpu: 640 } as const;

/** After this many frames the range is looked for again. */
const AGAIN = 60;

/** Over how many frames the frame rate is a mean. */
const MEAN = 10;

/** The pause after a frame that tells nothing, in ms. */
const PAUSE = 300;

/** The choice of a camera that gives both views. */
const BOTH = 'both';

export class VideoDialog {
    private readonly dialog = by<HTMLDialogElement>('video');
    private readonly canvas = by<HTMLCanvasElement>('live');
    /** What plays while the dialog is open. */
    private readonly turns = new Turns();
    private frames: Frames | undefined;
    private recording: Recording | undefined;
    private name = 'video';
    private width: number | undefined;

    /** `device` is the one to match on. */
    constructor(
        private readonly client: Client,
        private readonly device: () => Device,
    ) {
        by('open-video').addEventListener('click', () => this.open());
        by('video-close').addEventListener('click', () => this.dialog.close());
        this.dialog.addEventListener('close', () => void this.end());
        const file = by<HTMLInputElement>('video-file');
        file.addEventListener('change', () => {
            const [film] = file.files ?? [];
            if (film) {
                void this.play(film, film.name);
            }
        });
        file.addEventListener('click', () => (file.value = ''));
        by('video-film').addEventListener('click', () => file.click());
        const devices = navigator.mediaDevices as MediaDevices | undefined;
        by('video-cameras').hidden = !devices;
        by('video-cameras').addEventListener('click', () => void this.ask(devices as MediaDevices));
        for (const id of ['left-camera', 'right-camera']) {
            by(id).addEventListener('change', () => void this.film(devices as MediaDevices));
        }
        by('video-width').append(...WIDTHS.map((width) => make('option', { value: String(width), textContent: `${width} px` })));
        by('video-width').addEventListener('change', () => {
            this.width = Number(by<HTMLSelectElement>('video-width').value);
            this.again();
        });
        by('video-layout').addEventListener('change', () => {
            const [how, first] = by<HTMLSelectElement>('video-layout').value.split(' ');
            if (this.frames) {
                this.frames.layout = { how: how as 'beside' | 'above', leftFirst: first === 'left' };
                this.again();
            }
        });
        by('video-record').hidden = !canRecord();
        by('video-record').addEventListener('click', () => void this.record());
    }

    /** Opens the dialog, and plays a film if there is one. */
    open(film?: { file: Blob; name: string }): void {
        if (!this.dialog.open) {
            this.dialog.showModal();
        }
        void this.client.cancel();
        by<HTMLSelectElement>('video-width').value = String(this.width ?? USUAL[this.device()]);
        if (film) {
            void this.play(film.file, film.name);
        }
    }

    private play(file: Blob, name: string): Promise<void> {
        this.name = stem(name);
        this.choices(false);
        return this.run(() =>
            Frames.ofFilm(file).catch((error) => {
                throw new Error(`${name} cannot be played: ${words(error)}. Give a film that this browser plays, such as MP4 or WebM.`);
            }),
        );
    }

    /** Asks for the cameras, and takes the first ones. */
    private async ask(devices: MediaDevices): Promise<void> {
        const signal = this.turns.next();
        say('video-problem', undefined);
        this.stop();
        try {
            // The names of cameras are told only after a permission.
            const stream = await devices.getUserMedia({ video: true });
            stream.getTracks().forEach((track) => track.stop());
            const cameras = (await devices.enumerateDevices()).filter(({ kind }) => kind === 'videoinput');
            signal.throwIfAborted();
            const options = (first: number) =>
                cameras.map(({ deviceId, label }, i) => make('option', { value: deviceId, textContent: label || `camera ${i + 1}`, selected: i === first }));
            by('left-camera').replaceChildren(...options(0));
            by('right-camera').replaceChildren(make('option', { value: BOTH, textContent: 'the same: it gives both views' }), ...options(1));
            this.choices(true);
            await this.film(devices);
        } catch (error) {
            if (!signal.aborted) {
                say('video-problem', `The cameras cannot be used: ${words(error)}. Does this page have the permission, and does another program hold them?`);
            }
        }
    }

    /** Films with the chosen cameras. */
    private film(devices: MediaDevices): Promise<void> {
        this.name = 'cameras';
        const [left, right] = ['left-camera', 'right-camera'].map((id) => by<HTMLSelectElement>(id).value) as [string, string];
        return this.run(() => Frames.ofCameras(devices, right === BOTH || right === left ? [left] : [left, right]));
    }

    private choices(cameras: boolean): void {
        by('camera-choices').hidden = !cameras;
    }

    /** Begins anew with the same frames. */
    private again(): void {
        const { frames } = this;
        if (frames) {
            this.frames = undefined;
            void this.run(() => Promise.resolve(frames));
        }
    }

    /** Plays and matches frames until something else is played. */
    private async run(open: () => Promise<Frames>): Promise<void> {
        const signal = this.turns.next();
        say('video-problem', undefined);
        say('video-note', undefined);
        say('video-facts', 'Opening …');
        this.stop();
        try {
            await this.client.cancel();
            const frames = await open();
            if (signal.aborted) {
                frames.stop();
                return;
            }
            this.frames = frames;
            by('layout-choice').hidden = !frames.single;
            const { how, leftFirst } = frames.layout;
            by<HTMLSelectElement>('video-layout').value = `${how} ${leftFirst ? 'left' : 'right'}`;
            await this.match(frames, signal);
        } catch (error) {
            if (!signal.aborted) {
                this.stop();
                say('video-facts', undefined);
                say('video-problem', explained(error));
            }
        }
    }

    private async match(frames: Frames, signal: AbortSignal): Promise<void> {
        const call = this.client.within(signal);
        const device = await call('video', this.device());
        const times: number[] = [];
        for (let i = 0; ; i += 1) {
            const width = Number(by<HTMLSelectElement>('video-width').value);
            if (i % AGAIN === 0) {
                await this.learn(call, frames, width, i === 0, signal);
            }
            const frame = await frames.next(width);
            signal.throwIfAborted();
            const left = kept(frame[0]);
            const live = await call('frame', ...frame);
            this.draw(left, live);
            times.push(performance.now());
            const first = times.at(-1 - MEAN) ?? times[0] ?? 0;
            const counted = Math.min(MEAN, times.length - 1);
            const rate = counted > 0 ? `${((1000 * counted) / ((times.at(-1) ?? 0) - first)).toFixed(1)} frames a second` : 'first frame';
            this.canvas.dataset['frames'] = String(i + 1);
            say('video-facts', `${rate} · ${live.picture.width} × ${live.picture.height} pixels · range ${live.range.min} to ${live.range.max} · fast · ${device}`);
        }
    }

    /** Learns from the next frame, or for the first time from the next one that tells something. */
    private async learn(call: Client['call'], frames: Frames, width: number, first: boolean, signal: AbortSignal): Promise<void> {
        for (;;) {
            try {
                const notes = await call('learn', ...(await frames.next(width)));
                if (first) {
                    say('video-problem', undefined);
                    say('video-note', notes.join(' '));
                }
                return;
            } catch (error) {
                signal.throwIfAborted();
                if (error instanceof Interrupted || error instanceof Broken) {
                    throw error;
                }
                if (!first) {
                    return;
                }
                say('video-facts', 'Looking for a frame with matches …');
                say('video-problem', `${words(error)}. Do both views show the same scene, and is the left one first?`);
                await new Promise((resolve) => setTimeout(resolve, PAUSE));
            }
        }
    }

    /** Shows the left view with its depth beside it, or below it on a narrow page. */
    private draw(left: OffscreenCanvas, { picture, left: rectified }: Live): void {
        const { width, height } = picture;
        const below = this.dialog.clientWidth < 560;
        const [w, h] = below ? [width, 2 * height] : [2 * width, height];
        if (this.canvas.width !== w || this.canvas.height !== h) {
            // A recording has one size.
            void this.keep();
            [this.canvas.width, this.canvas.height] = [w, h];
        }
        const context = this.canvas.getContext('2d');
        const data = (of: typeof picture) => new ImageData(of.pixels, of.width, of.height);
        if (rectified) {
            context?.putImageData(data(rectified), 0, 0);
        } else {
            context?.drawImage(left, 0, 0);
        }
        context?.putImageData(data(picture), below ? 0 : width, below ? height : 0);
    }

    /** Starts or ends a recording. */
    private async record(): Promise<void> {
        if (this.recording) {
            await this.keep();
            return;
        }
        try {
            this.recording = new Recording(this.canvas);
            by('video-record').textContent = 'End and save';
        } catch (error) {
            say('video-problem', words(error));
        }
    }

    /** Ends the recording, if there is one, and shares or saves it. */
    private async keep(): Promise<void> {
        const { recording } = this;
        this.recording = undefined;
        by('video-record').textContent = 'Record';
        if (recording) {
            try {
                await share(await recording.stop(`${this.name}-depth`));
            } catch (error) {
                say('video-problem', `The film cannot be saved: ${words(error)}`);
            }
        }
    }

    private stop(): void {
        this.frames?.stop();
        this.frames = undefined;
    }

    private async end(): Promise<void> {
        this.turns.next();
        await this.keep();
        this.stop();
        this.choices(false);
        say('video-facts', undefined);
        await this.client.call('endVideo').catch(() => {});
    }
}

/** A copy of an image, which itself goes to the worker. */
function kept(image: ImageBitmap): OffscreenCanvas {
    const canvas = new OffscreenCanvas(image.width, image.height);
    canvas.getContext('2d')?.drawImage(image, 0, 0);
    return canvas;
}
