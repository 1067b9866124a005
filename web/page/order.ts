// Tells left from right views by their file names.

/** The words and numbers in a name, without folder and extension. */
function parts(name: string): string[] {
    const stem = name.replace(/^.*[\\/]/, '').replace(/\.[^.]*$/, '');
    // Words end at digits and capitals: imgL, leftImage, view5.
    return (stem.match(/\d+|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[A-Z]/g) ?? []).map((part) => part.toLowerCase());
}

/** -1 for a word that names the left view, 1 for the right view, 0 otherwise. */
const side = (part: string): number => (['left', 'l'].includes(part) ? -1 : ['right', 'r'].includes(part) ? 1 : 0);

/** Compares two numbers of any length; a missing number is the smallest. 0 for words. */
function lower(one: string, other: string): number {
    if (!/^\d*$/.test(one) || !/^\d*$/.test(other)) {
        return 0;
    }
    const [a, b] = [one, other].map((part) => (part === '' ? -1n : BigInt(part))) as [bigint, bigint];
    return a < b ? -1 : a > b ? 1 : 0;
}

/** Below 0 if `a` is the left view, above 0 if `b` is, 0 if the names do not tell. */
function compared(a: string, b: string): number {
    const [first, second] = [parts(a), parts(b)];
    const both = Array.from({ length: Math.max(first.length, second.length) }, (_, i) => [first[i] ?? '', second[i] ?? ''] as const);
    // Words take precedence over numbers, as the right view may have been taken first.
    const words = both.map(([one, other]) => side(one) - side(other));
    return [...words, ...both.map(([one, other]) => lower(one, other))].find((order) => order !== 0) ?? 0;
}

/** Files in the order of their names, as of views; as they came where their names do not tell. */
export const ordered = <T extends { name: string }>(files: T[]): T[] => [...files].sort((a, b) => compared(a.name, b.name));

/** Two views, the left one first; as they came where their names do not tell. */
export function inOrder<T extends { name: string }>(a: T, b: T): [T, T] {
    return compared(a.name, b.name) > 0 ? [b, a] : [a, b];
}
