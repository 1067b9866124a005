// Files of what is known of the left view beforehand: lists of points, point clouds, and maps of disparities or depths.

import { type Named, TEXT } from './dropped';
import { header } from './header';

/** The start of a list that is looked at, in bytes. */
const START = 4096;
/** A point of a list: x, y, disparity, and perhaps the standard deviation. */
const POINT = /^("?[-+.\deE]+"?\s*(,\s*|$)){3,4}$/;
/** Names that say what a map is for. Others may be views, or the truth in a folder of a benchmark. */
const NAMED = /prior|known|lidar|depth/i;
/** Names of point clouds, except in a folder, where they may be the truth. */
const CLOUD = /\.(ply|xyz)$/i;
/** How an array of NumPy begins, after its first byte. */
const NUMPY = 'NUMPY';

/** Whether a text is a list of points, perhaps below a line with names. */
async function isList(file: Blob): Promise<boolean> {
    const lines = (await file.slice(0, START).text()).split(/\r?\n/).map((line) => line.trim()).filter(Boolean);
    return lines.slice(0, 2).some((line) => POINT.test(line));
}

/** Whether a file is a list. A .csv file is, except in a folder, where it may be anything. */
async function listed({ file, name }: Named, inFolder: boolean): Promise<boolean> {
    return /\.csv$/i.test(name) && !inFolder ? true : /\.(csv|txt)$/i.test(name) && isList(file);
}

/** Whether a file is an array of NumPy. */
async function isArray(file: Blob): Promise<boolean> {
    return (await file.slice(1, 1 + NUMPY.length).text()) === NUMPY;
}

/** Whether a file is a map, by its name and its header. Depths in a folder may be the truth. */
async function mapped({ file, name }: Named, inFolder: boolean): Promise<boolean> {
    const isNamed = NAMED.test(name) && !(inFolder && /depth/i.test(name));
    return isNamed && (((await header(file))?.map ?? false) || isArray(file));
}

/**
 * The file of what is known among these, if there is one, and the others. A map counts beside two views, or as the only image if the pair is
 * `complete`; else it may be a view.
 */
export async function apart(files: Named[], inFolder: boolean, complete: boolean): Promise<{ prior: Named | undefined; others: Named[] }> {
    const those = async (is: (file: Named) => Promise<boolean>): Promise<Named[]> => {
        // A file that cannot be read is reported with the others.
        const found = await Promise.all(files.map((file) => is(file).catch(() => false)));
        return files.filter((_, i) => found[i]);
    };
    const lists = await those((file) => listed(file, inFolder));
    const clouds = inFolder ? [] : files.filter(({ name }) => CLOUD.test(name));
    const images = files.filter((file) => !lists.includes(file) && !clouds.includes(file) && !TEXT.test(file.name));
    const maps = images.length > 2 || (images.length === 1 && complete) ? await those((file) => mapped(file, inFolder)) : [];
    const [prior, second] = [...lists, ...clouds, ...(maps.length === 1 ? maps : [])];
    if (prior && second) {
        throw new Error(`${prior.name} and ${second.name} are both of what is known: give one of them.`);
    }
    return { prior, others: files.filter((file) => file !== prior) };
}
