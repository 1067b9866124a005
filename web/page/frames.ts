// Where the frames of a video come from: a film with both views, or cameras.

import type { Halves } from './both';
import { guess } from './decode';

/** Both views of a frame. */
export type Frame = [ImageBitmap, ImageBitmap];

export class Frames {
    /** How a single picture holds both views. */
    layout: Halves = { how: 'beside', leftFirst: true };

    private constructor(
        private readonly videos: HTMLVideoElement[],
        private readonly end: () => void,
    ) {}

    /** The frames of a film, again and again. */
    static async ofFilm(file: Blob): Promise<Frames> {
        const url = URL.createObjectURL(file);
        const video = made();
        video.loop = true;
        video.src = url;
        const frames = new Frames([video], () => {
            video.removeAttribute('src');
            video.load();
            URL.revokeObjectURL(url);
        });
        try {
            await frames.begin();
        } catch (error) {
            frames.stop();
            throw error;
        }
        return frames;
    }

    /** The frames of one camera that gives both views, or of two. */
    static async ofCameras(devices: MediaDevices, ids: string[]): Promise<Frames> {
        const streams: MediaStream[] = [];
        const frames = new Frames(ids.map(made), () => streams.flatMap((stream) => stream.getTracks()).forEach((track) => track.stop()));
        try {
            for (const [i, id] of ids.entries()) {
                // A camera with both views is twice as wide.
                const width = { ideal: ids.length === 1 ? 2560 : 1280 };
                const stream = await devices.getUserMedia({ video: { deviceId: { exact: id }, width } });
                streams.push(stream);
                (frames.videos[i] as HTMLVideoElement).srcObject = stream;
            }
            await frames.begin();
        } catch (error) {
            frames.stop();
            throw error;
        }
        return frames;
    }

    /** Whether one picture holds both views. */
    get single(): boolean {
        return this.videos.length === 1;
    }

    /** The current frame, at most `width` pixels wide. */
    async next(width: number): Promise<Frame> {
        const [one, other] = this.videos as [HTMLVideoElement, HTMLVideoElement | undefined];
        const [w, h] = [one.videoWidth, one.videoHeight];
        if (other) {
            if (other.videoWidth * h !== other.videoHeight * w) {
                throw new Error(`The left camera gives ${w} × ${h} pixels and the right one ${other.videoWidth} × ${other.videoHeight}. Take two of one kind.`);
            }
            const most = Math.min(width, w, other.videoWidth);
            return Promise.all([part(one, 0, 0, w, h, most, h / w), part(other, 0, 0, other.videoWidth, other.videoHeight, most, h / w)]);
        }
        const { how, leftFirst } = this.layout;
        const [wide, high] = how === 'beside' ? [w >> 1, h] : [w, h >> 1];
        const at = (second: boolean): [number, number] => (second ? [w - wide, h - high] : [0, 0]);
        return Promise.all([!leftFirst, leftFirst].map((second) => part(one, ...at(second), wide, high, width, high / wide))) as Promise<Frame>;
    }

    stop(): void {
        this.videos.forEach((video) => {
            video.pause();
            video.srcObject = null;
        });
        this.end();
    }

    private async begin(): Promise<void> {
        await Promise.all(this.videos.map((video) => video.play()));
        const [one, other] = this.videos;
        if (one && !other) {
            this.layout.how = (await guess(one)) ?? 'beside';
        }
    }
}

function made(): HTMLVideoElement {
    return Object.assign(document.createElement('video'), { muted: true, playsInline: true });
}

/** A part of the picture, at most `most` pixels wide, and this many times as high as wide. */
function part(video: HTMLVideoElement, x: number, y: number, width: number, height: number, most: number, aspect: number): Promise<ImageBitmap> {
    const resizeWidth = Math.min(width, most);
    const resizeHeight = Math.max(1, Math.round(resizeWidth * aspect));
    return createImageBitmap(video, x, y, width, height, { resizeWidth, resizeHeight, resizeQuality: 'medium' });
}
