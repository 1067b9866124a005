// Files for the user.

import { make } from './dom';

/** Offers bytes as a download. */
export function save(bytes: Uint8Array<ArrayBuffer>, name: string, type: string): void {
    const url = URL.createObjectURL(new Blob([bytes], { type }));
    const link = make('a', { href: url, download: name });
    document.body.append(link);
    link.click();
    link.remove();
    // The browser has taken the file by then.
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

/** The name of a pair's files: that of the scene, or of the left view without the folder and the extension. */
export function stem(left: string): string {
    return left.replace(/^.*[\\/]/, '').replace(/\.[^.]*$/, '').replace(/[^\p{L}\p{N}._-]+/gu, '-') || 'pair';
}
