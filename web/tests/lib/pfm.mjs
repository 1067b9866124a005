// Reads the maps of the program.

/** Disparities of a PFM file, top row first. */
export function disparities(file) {
    const [, width, height] = file.toString('latin1', 0, 40).match(/^Pf\n(\d+) (\d+)\n-1(?:\.0)?\n/).map(Number);
    const start = file.length - 4 * width * height;
    return { width, height, at: (x, y) => file.readFloatLE(start + 4 * ((height - 1 - y) * width + x)) };
}
