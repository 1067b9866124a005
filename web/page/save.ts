// Downloads for the user.

import { make } from './dom';

/** Offers bytes as a download. */
export function save(bytes: Uint8Array<ArrayBuffer> | Blob, name: string, type: string): void {
    const url = URL.createObjectURL(new Blob([bytes], { type }));
    const link = make('a', { href: url, download: name });
    document.body.append(link);
    link.click();
    link.remove();
    // By then the browser has read the data.
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

/** Shares a file where the system can share files, as phones do, and else saves it. */
export async function share(file: File): Promise<void> {
    if (matchMedia('(pointer: coarse)').matches && navigator.canShare?.({ files: [file] })) {
        // Closing the dialog of the system is no failure.
        await navigator.share({ files: [file] }).catch((error) => {
            if ((error as DOMException).name !== 'AbortError') {
                throw error;
            }
        });
        return;
    }
    save(file, file.name, file.type);
}

/** The prefix of saved files: the scene, or the left file without folder and extension. */
export function stem(left: string): string {
    return left.replace(/^.*[\\/]/, '').replace(/\.[^.]*$/, '').replace(/[^\p{L}\p{N}._-]+/gu, '-') || 'pair';
}
