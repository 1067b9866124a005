// PNG pictures and maps.
import { PNG } from 'pngjs';

/** Decodes an 8-bit grey PNG. */
export function levels(file) {
    const { width, height, data } = PNG.sync.read(file);
    // The decoder returns grey as RGBA.
    return { width, height, levels: Uint8Array.from({ length: width * height }, (_, i) => data[4 * i]) };
}

/** A smaller picture as PNG; each pixel is the mean of those that it covers. */
export function shrunk(file, width, height) {
    const large = PNG.sync.read(file);
    const small = new PNG({ width, height });
    for (let y = 0; y < height; y += 1) {
        for (let x = 0; x < width; x += 1) {
            const [top, bottom] = [(y * large.height) / height, ((y + 1) * large.height) / height];
            const [left, right] = [(x * large.width) / width, ((x + 1) * large.width) / width];
            const sums = [0, 0, 0, 0];
            for (let j = Math.floor(top); j < bottom; j += 1) {
                for (let i = Math.floor(left); i < right; i += 1) {
                    // Pixels at the border are weighted by the fraction covered.
                    const part = (Math.min(j + 1, bottom) - Math.max(j, top)) * (Math.min(i + 1, right) - Math.max(i, left));
                    sums.forEach((sum, c) => (sums[c] = sum + part * large.data[4 * (j * large.width + i) + c]));
                }
            }
            const area = (bottom - top) * (right - left);
            sums.forEach((sum, c) => (small.data[4 * (y * width + x) + c] = Math.round(sum / area)));
        }
    }
    // Paeth's filter compresses photographs best.
    return PNG.sync.write(small, { colorType: 2, filterType: 4 });
}
