// Parses the first bytes of an image file, so that a slot can refuse it before the engine decodes it.

export interface Header {
    format: 'PNG' | 'JPEG' | 'PNM' | 'PFM' | 'TIFF';
    /** Undefined if it is not in the first bytes. */
    size: { width: number; height: number } | undefined;
    /** Whether it may hold disparities: grey floats, or in a PNG grey of 16 bits. */
    map: boolean;
}

/** How far to search for the size in a JPEG file, after the metadata of the camera. */
const REACH = 1 << 20;

/** The format of an image file; undefined if the engine does not read it. */
export async function header(file: Blob): Promise<Header | undefined> {
    const view = new DataView(await file.slice(0, REACH).arrayBuffer());
    const starts = (...bytes: number[]) =>
        view.byteLength >= bytes.length && bytes.every((byte, i) => view.getUint8(i) === byte);
    if (starts(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a)) {
        const size = view.byteLength >= 24 ? { width: view.getUint32(16), height: view.getUint32(20) } : undefined;
        return { format: 'PNG', size, map: size !== undefined && view.byteLength > 25 && view.getUint8(24) === 16 && view.getUint8(25) === 0 };
    }
    if (starts(0xff, 0xd8, 0xff)) {
        return { format: 'JPEG', size: jpeg(view), map: false };
    }
    if (starts(0x49, 0x49, 0x2a, 0) || starts(0x4d, 0x4d, 0, 0x2a)) {
        return { format: 'TIFF', ...(await tiff(file, view)) };
    }
    if (starts(0x49, 0x49, 0x2b, 0) || starts(0x4d, 0x4d, 0, 0x2b)) {
        // The directory of a BigTIFF file has another form.
        return { format: 'TIFF', size: undefined, map: false };
    }
    const text = new TextDecoder('latin1').decode(new Uint8Array(view.buffer, 0, Math.min(1024, view.byteLength)));
    const numbers = text.replace(/#[^\n]*/g, '').match(/^P([1-6Ff])\s+(\d+)\s+(\d+)\s/);
    if (numbers) {
        const size = { width: Number(numbers[2]), height: Number(numbers[3]) };
        return { format: /f/i.test(numbers[1] ?? '') ? 'PFM' : 'PNM', size, map: numbers[1] === 'f' };
    }
    const pam = [/^P7\s[^]*?^WIDTH\s+(\d+)/m, /^P7\s[^]*?^HEIGHT\s+(\d+)/m].map((field) => Number(text.match(field)?.[1]));
    if (/^P7\s/.test(text)) {
        return { format: 'PNM', size: pam[0] && pam[1] ? { width: pam[0], height: pam[1] } : undefined, map: false };
    }
    return undefined;
}

/** Whether a file is an HEIC photo, as iPhones take them. */
export async function isHeif(file: Blob): Promise<boolean> {
    const text = new TextDecoder('latin1').decode(await file.slice(0, 12).arrayBuffer());
    return /^.{4}ftyp(hei[cmsx]|hev[cmsx]|mif1|msf1)$/s.test(text);
}

/** The size in the first frame header. */
function jpeg(view: DataView): Header['size'] {
    let at = 2;
    while (at + 9 < view.byteLength && view.getUint8(at) === 0xff) {
        const marker = view.getUint8(at + 1);
        // Frame headers are C0 to CF, except for three of them.
        if (marker >= 0xc0 && marker <= 0xcf && ![0xc4, 0xc8, 0xcc].includes(marker)) {
            return { width: view.getUint16(at + 7), height: view.getUint16(at + 5) };
        }
        at += 2 + view.getUint16(at + 2);
    }
    return undefined;
}

/** What the first directory says, which may follow the pixels. */
async function tiff(file: Blob, start: DataView): Promise<Pick<Header, 'size' | 'map'>> {
    const little = start.getUint8(0) === 0x49;
    if (start.byteLength < 8) {
        return { size: undefined, map: false };
    }
    const at = start.getUint32(4, little);
    const directory = new DataView(await file.slice(at, at + 2 + 12 * 64).arrayBuffer());
    const values = new Map<number, number>();
    for (let entry = 2; entry + 12 <= directory.byteLength; entry += 12) {
        const [tag, type] = [directory.getUint16(entry, little), directory.getUint16(entry + 2, little)];
        if (tag === 256 || tag === 257 || tag === 277 || tag === 339) {
            const value = type === 3 ? directory.getUint16(entry + 8, little) : directory.getUint32(entry + 8, little);
            values.set(tag, value);
        }
    }
    // Width, height, samples of a pixel and their format, of which 3 is float.
    const [width, height, samples = 1, format = 1] = [256, 257, 277, 339].map((tag) => values.get(tag));
    return { size: width && height ? { width, height } : undefined, map: samples === 1 && format === 3 };
}
