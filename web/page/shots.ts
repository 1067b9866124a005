// Takes a pair with the camera of this device: one view, a step to the right, the other view.

import { by, say, words } from './dom';
import type { Named } from './dropped';
import { Turns } from './turns';

/** The instructions before each shot. */
const SHOTS = [
    { which: 'left', take: 'Take the left view', about: 'Point at something that stands still, with things near and far.' },
    { which: 'right', take: 'Take the right view', about: 'Now move a hand’s width to the right without turning, at the same height, and take the same again.' },
] as const;

/** Offers the camera if there is one; `taken` receives both views. */
export function offerCamera(taken: (views: Named[]) => void): void {
    const devices = navigator.mediaDevices as MediaDevices | undefined;
    by('open-camera').hidden = !devices;
    if (devices) {
        const shots = new Shots(devices, taken);
        by('open-camera').addEventListener('click', () => void shots.open());
    }
}

class Shots {
    private readonly dialog = by<HTMLDialogElement>('camera');
    private readonly video = by('camera').querySelector('video') as HTMLVideoElement;
    private stream: MediaStream | undefined;
    private views: Named[] = [];
    /** Whether a shot is being taken. */
    private busy = false;
    /** The dialog while it is open. */
    private readonly turns = new Turns();

    constructor(
        private readonly devices: MediaDevices,
        private readonly taken: (views: Named[]) => void,
    ) {
        by('shoot').addEventListener('click', () => void this.shoot());
        by('close-camera').addEventListener('click', () => this.dialog.close());
        // Also on Escape.
        this.dialog.addEventListener('close', () => this.stop());
    }

    async open(): Promise<void> {
        const signal = this.turns.next();
        this.views = [];
        this.ask();
        say('camera-problem', undefined);
        by<HTMLButtonElement>('shoot').disabled = true;
        this.dialog.showModal();
        try {
            const video = { facingMode: 'environment', width: { ideal: 1280 }, height: { ideal: 960 } };
            const stream = await this.devices.getUserMedia({ video });
            if (signal.aborted) {
                stream.getTracks().forEach((track) => track.stop());
                return;
            }
            this.stream = stream;
            this.video.srcObject = stream;
            await this.video.play();
            signal.throwIfAborted();
            by<HTMLButtonElement>('shoot').disabled = false;
        } catch (error) {
            if (signal.aborted) {
                return;
            }
            say('camera-problem', `The camera cannot be used: ${words(error)}. Does this page have the permission, and does another program hold it?`);
        }
    }

    /** Asks for the next shot. */
    private ask(): void {
        const shot = SHOTS[this.views.length];
        if (shot) {
            by('shoot').textContent = shot.take;
            say('camera-about', shot.about);
        }
    }

    private async shoot(): Promise<void> {
        if (this.busy) {
            return;
        }
        const { signal } = this.turns;
        const { videoWidth, videoHeight } = this.video;
        const canvas = new OffscreenCanvas(videoWidth, videoHeight);
        canvas.getContext('2d')?.drawImage(this.video, 0, 0);
        this.busy = true;
        const file = await canvas.convertToBlob({ type: 'image/png' }).finally(() => (this.busy = false));
        if (signal.aborted) {
            return;
        }
        this.views.push({ file, name: `camera ${SHOTS[this.views.length]?.which}.png` });
        if (this.views.length < SHOTS.length) {
            this.ask();
            return;
        }
        const views = this.views;
        this.dialog.close();
        this.taken(views);
    }

    private stop(): void {
        this.turns.next();
        this.stream?.getTracks().forEach((track) => track.stop());
        this.stream = undefined;
        this.video.srcObject = null;
    }
}
