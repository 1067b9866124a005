// PNG files of 8 bits a channel, grey or RGB, without interlacing: what the rendered scenes and the maps are.
import { crc32, deflateSync, inflateSync } from 'node:zlib';

const SIGNATURE = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);

/** @returns {{ width: number, height: number, channels: number, pixels: Uint8Array }} */
export function decode(file) {
    if (!SIGNATURE.equals(file.subarray(0, 8))) {
        throw new Error('this is no PNG file');
    }
    let [width, height, channels] = [0, 0, 0];
    const parts = [];
    for (let at = 8; at < file.length; ) {
        const [length, type] = [file.readUInt32BE(at), file.toString('latin1', at + 4, at + 8)];
        const data = file.subarray(at + 8, at + 8 + length);
        if (type === 'IHDR') {
            [width, height, channels] = [data.readUInt32BE(0), data.readUInt32BE(4), { 0: 1, 2: 3 }[data[9]]];
            if (data[8] !== 8 || !channels || data[12] !== 0) {
                throw new Error('only 8-bit grey and RGB without interlacing are read here');
            }
        } else if (type === 'IDAT') {
            parts.push(data);
        }
        at += length + 12;
    }
    const lines = inflateSync(Buffer.concat(parts));
    const row = width * channels;
    const pixels = new Uint8Array(row * height);
    for (let y = 0; y < height; y += 1) {
        const filter = lines[y * (row + 1)];
        for (let i = 0; i < row; i += 1) {
            const a = i < channels ? 0 : pixels[y * row + i - channels];
            const b = y === 0 ? 0 : pixels[(y - 1) * row + i];
            const c = i < channels || y === 0 ? 0 : pixels[(y - 1) * row + i - channels];
            const guess = [0, a, b, (a + b) >> 1, paeth(a, b, c)][filter];
            pixels[y * row + i] = lines[y * (row + 1) + 1 + i] + guess;
        }
    }
    return { width, height, channels, pixels };
}

function paeth(a, b, c) {
    const [pa, pb, pc] = [Math.abs(b - c), Math.abs(a - c), Math.abs(a + b - 2 * c)];
    return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

export function encode({ width, height, channels, pixels }) {
    const row = width * channels;
    const lines = Buffer.alloc((row + 1) * height);
    for (let y = 0; y < height; y += 1) {
        // Every line as the difference to the pixel at its left and above, whichever is nearer: photographs like Paeth's filter.
        lines[y * (row + 1)] = 4;
        for (let i = 0; i < row; i += 1) {
            const a = i < channels ? 0 : pixels[y * row + i - channels];
            const b = y === 0 ? 0 : pixels[(y - 1) * row + i];
            const c = i < channels || y === 0 ? 0 : pixels[(y - 1) * row + i - channels];
            lines[y * (row + 1) + 1 + i] = pixels[y * row + i] - paeth(a, b, c);
        }
    }
    const header = Buffer.alloc(13);
    header.writeUInt32BE(width, 0);
    header.writeUInt32BE(height, 4);
    header.set([8, channels === 3 ? 2 : 0, 0, 0, 0], 8);
    const chunk = (type, data) => {
        const body = Buffer.concat([Buffer.from(type, 'latin1'), data]);
        const ends = [Buffer.alloc(4), Buffer.alloc(4)];
        ends[0].writeUInt32BE(data.length);
        ends[1].writeUInt32BE(crc32(body));
        return Buffer.concat([ends[0], body, ends[1]]);
    };
    const data = deflateSync(lines, { level: 9 });
    return Buffer.concat([SIGNATURE, chunk('IHDR', header), chunk('IDAT', data), chunk('IEND', Buffer.alloc(0))]);
}

/** A picture of this size, each pixel the mean of those that it covers. */
export function shrink({ width, height, channels, pixels }, to, high) {
    const small = new Uint8Array(to * high * channels);
    for (let y = 0; y < high; y += 1) {
        for (let x = 0; x < to; x += 1) {
            for (let c = 0; c < channels; c += 1) {
                let [sum, weight] = [0, 0];
                // Pixels at the border count by the part that is covered.
                const [top, bottom] = [(y * height) / high, ((y + 1) * height) / high];
                const [left, right] = [(x * width) / to, ((x + 1) * width) / to];
                for (let j = Math.floor(top); j < bottom; j += 1) {
                    for (let i = Math.floor(left); i < right; i += 1) {
                        const part = (Math.min(j + 1, bottom) - Math.max(j, top)) * (Math.min(i + 1, right) - Math.max(i, left));
                        sum += part * pixels[(j * width + i) * channels + c];
                        weight += part;
                    }
                }
                small[(y * to + x) * channels + c] = Math.round(sum / weight);
            }
        }
    }
    return { width: to, height: high, channels, pixels: small };
}
