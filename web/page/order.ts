// Which of two files is the left view, by their names.

/** The parts of a name that tell views apart: words and numbers, without the folder and the extension. */
function parts(name: string): string[] {
    const stem = name.replace(/^.*[\\/]/, '').replace(/\.[^.]*$/, '');
    // Words end where digits or capitals begin: imgL, leftImage, view5.
    return (stem.match(/\d+|[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[A-Z]/g) ?? []).map((part) => part.toLowerCase());
}

/** Whether `b` is the left view of the two; false where the names do not tell. */
export function swapped(a: string, b: string): boolean {
    const [first, second] = [parts(a), parts(b)];
    const length = Math.max(first.length, second.length);
    for (let i = 0; i < length; i += 1) {
        const [one, other] = [first[i] ?? '', second[i] ?? ''];
        if (one === other) {
            continue;
        }
        if (/^\d+$/.test(one) && /^\d+$/.test(other)) {
            return Number(one) > Number(other);
        }
        if (['left', 'l'].includes(other) || ['right', 'r'].includes(one)) {
            return true;
        }
        if (['left', 'l'].includes(one) || ['right', 'r'].includes(other)) {
            return false;
        }
    }
    return false;
}
