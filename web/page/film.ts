// Records a canvas as a film.

/** The formats of films, the most widely played first. */
const FORMATS = [
    { type: 'video/mp4;codecs=avc1.640028', end: 'mp4' },
    { type: 'video/mp4', end: 'mp4' },
    { type: 'video/webm;codecs=vp9', end: 'webm' },
    { type: 'video/webm', end: 'webm' },
];

/** Frames a second at most, and bits a second. */
const RATE = 30;
const BITS = 8_000_000;

/** The formats that this browser can record, by preference. */
const recordable = () => (typeof MediaRecorder === 'undefined' ? [] : FORMATS.filter(({ type }) => MediaRecorder.isTypeSupported(type)));

export const canRecord = (): boolean => recordable().length > 0;

/** A film of what is drawn on a canvas from now on. */
export class Recording {
    private readonly recorder: MediaRecorder;
    private readonly parts: Blob[] = [];
    private readonly end: string;

    /** Throws if the browser cannot record. */
    constructor(canvas: HTMLCanvasElement) {
        const [format] = recordable();
        if (!format) {
            throw new Error('This browser cannot record films.');
        }
        this.end = format.end;
        this.recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType: format.type, videoBitsPerSecond: BITS });
        this.recorder.addEventListener('dataavailable', ({ data }) => this.parts.push(data));
        this.recorder.start();
    }

    /** Ends the film and returns it as the file `name` with the extension of its format. */
    async stop(name: string): Promise<File> {
        const ended = new Promise((resolve, reject) => {
            this.recorder.addEventListener('stop', resolve, { once: true });
            this.recorder.addEventListener('error', (event) => reject((event as unknown as { error: Error }).error), { once: true });
        });
        this.recorder.stop();
        this.recorder.stream.getTracks().forEach((track) => track.stop());
        await ended;
        const type = this.recorder.mimeType.replace(/;.*/, '');
        return new File(this.parts, `${name}.${this.end}`, { type });
    }
}
