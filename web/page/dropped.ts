// Files and folders dropped on the page.

export interface Named {
    file: Blob;
    name: string;
}

/** Files that operating systems create in folders. */
const HIDDEN = /^(\.|desktop\.ini$|thumbs\.db$)/i;

/** The dropped files, and the name of their folder if there is one. */
export async function dropped(transfer: DataTransfer): Promise<{ files: Named[]; folder: string | undefined }> {
    // Must be read before the first await, as the lists are cleared afterwards.
    const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry !== null && entry !== undefined);
    const plain = [...transfer.files];
    if (!entries.some((entry) => entry.isDirectory)) {
        return { files: plain.map(named), folder: undefined };
    }
    const files = await Promise.all(entries.map((entry) => (entry.isDirectory ? listed(entry as FileSystemDirectoryEntry) : opened([entry]))));
    return { files: files.flat().map(named), folder: entries.length === 1 ? entries[0]?.name : undefined };
}

export const named = (file: File): Named => ({ file, name: file.name || 'pasted image' });

const opened = (entries: FileSystemEntry[]): Promise<File[]> =>
    Promise.all(entries.filter((entry): entry is FileSystemFileEntry => entry.isFile).map((entry) => new Promise<File>((resolve, reject) => entry.file(resolve, reject))));

const { compare } = new Intl.Collator('en', { numeric: true });

/** The files of a folder, sorted by name; the reader returns them in batches in any order. */
async function listed(folder: FileSystemDirectoryEntry): Promise<File[]> {
    const reader = folder.createReader();
    const all: FileSystemEntry[] = [];
    for (;;) {
        const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
        if (some.length === 0) {
            const files = await opened(all);
            return files.filter(({ name }) => !HIDDEN.test(name)).sort((a, b) => compare(a.name, b.name));
        }
        all.push(...some);
    }
}
