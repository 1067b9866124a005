// Pictures and maps in PNG files.
import { PNG } from 'pngjs';

/** The levels of a grey file of 8 bits. */
export function levels(file) {
    const { width, height, data } = PNG.sync.read(file);
    // Grey comes as RGBA.
    return { width, height, levels: Uint8Array.from({ length: width * height }, (_, i) => data[4 * i]) };
}

/** The file of a smaller picture, each of its pixels the mean of those that it covers. */
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
                    // Pixels at the border count by the part that is covered.
                    const part = (Math.min(j + 1, bottom) - Math.max(j, top)) * (Math.min(i + 1, right) - Math.max(i, left));
                    sums.forEach((sum, c) => (sums[c] = sum + part * large.data[4 * (j * large.width + i) + c]));
                }
            }
            const area = (bottom - top) * (right - left);
            sums.forEach((sum, c) => (small.data[4 * (y * width + x) + c] = Math.round(sum / area)));
        }
    }
    // Photographs are smallest as differences to the neighbours (Paeth's filter).
    return PNG.sync.write(small, { colorType: 2, filterType: 4 });
}
