// A pair by the camera of this device: one view, a step to the right, the other view.

import { by, say, words } from './dom';
import type { Named } from './dropped';

/** What the dialog says before each shot. */
const SHOTS = [
    { which: 'left', take: 'Take the left view', about: 'Point at something that stands still, with things near and far.' },
    { which: 'right', take: 'Take the right view', about: 'Now move a hand’s width to the right without turning, at the same height, and take the same again.' },
] as const;

/** Offers the camera where there is one; `taken` gets both views. */
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

    constructor(
        private readonly devices: MediaDevices,
        private readonly taken: (views: Named[]) => void,
    ) {
        by('shoot').addEventListener('click', () => void this.shoot());
        by('close-camera').addEventListener('click', () => this.dialog.close());
        // By Escape, too.
        this.dialog.addEventListener('close', () => this.stop());
    }

    async open(): Promise<void> {
        this.views = [];
        this.ask();
        say('camera-problem', undefined);
        by<HTMLButtonElement>('shoot').disabled = true;
        this.dialog.showModal();
        try {
            const video = { facingMode: 'environment', width: { ideal: 1280 }, height: { ideal: 960 } };
            const stream = await this.devices.getUserMedia({ video });
            if (!this.dialog.open) {
                stream.getTracks().forEach((track) => track.stop());
                return;
            }
            this.stream = stream;
            this.video.srcObject = stream;
            await this.video.play();
            by<HTMLButtonElement>('shoot').disabled = false;
        } catch (error) {
            say('camera-problem', `The camera cannot be used: ${words(error)}. Does this page have the permission, and does another program hold it?`);
        }
    }

    /** What the next shot is of. */
    private ask(): void {
        const shot = SHOTS[this.views.length];
        if (shot) {
            by('shoot').textContent = shot.take;
            say('camera-about', shot.about);
        }
    }

    private async shoot(): Promise<void> {
        const { videoWidth, videoHeight } = this.video;
        const canvas = new OffscreenCanvas(videoWidth, videoHeight);
        canvas.getContext('2d')?.drawImage(this.video, 0, 0);
        const file = await canvas.convertToBlob({ type: 'image/png' });
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
        this.stream?.getTracks().forEach((track) => track.stop());
        this.stream = undefined;
        this.video.srcObject = null;
    }
}
