// What is dropped on the page: files, and the files of a folder.

export interface Named {
    file: Blob;
    name: string;
}

/** The files of a drop, and the name of the folder that they are from. */
export async function dropped(transfer: DataTransfer): Promise<{ files: Named[]; folder: string | undefined }> {
    // To be asked for before anything is awaited: the list is empty afterwards.
    const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.() ?? undefined);
    const folders = entries.filter((entry) => entry?.isDirectory) as FileSystemDirectoryEntry[];
    if (folders.length !== 1 || entries.length !== 1) {
        return { files: [...transfer.files].map(named), folder: undefined };
    }
    const [folder] = folders as [FileSystemDirectoryEntry];
    const found = (await listed(folder)).filter((entry): entry is FileSystemFileEntry => entry.isFile);
    const files = await Promise.all(found.map((entry) => new Promise<File>((resolve, reject) => entry.file(resolve, reject))));
    return { files: files.map(named), folder: folder.name };
}

export const named = (file: File): Named => ({ file, name: file.name || 'pasted image' });

/** What a folder holds; a reader gives some at a time. */
async function listed(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
    const reader = folder.createReader();
    const all: FileSystemEntry[] = [];
    for (;;) {
        const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
        if (some.length === 0) {
            return all;
        }
        all.push(...some);
    }
}
