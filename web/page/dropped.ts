// Files and folders dropped on the page.

/** Files that may be a calibration. */
export const TEXT = /\.(txt|ya?ml|json|xml|ini|conf|cfg|calib|toml)$/i;

export interface Named {
    file: Blob;
    name: string;
}

/** Files that operating systems create in folders. */
const HIDDEN = /^(\.|desktop\.ini$|thumbs\.db$)/i;

/** Files that may be views. */
const IMAGE = /\.(png|jpe?g|webp|avif|gif|p[bgnp]m|tiff?|bmp)$/i;
/** Folders of benchmarks that hold no views. */
const NO_VIEWS = /^(disp|depth|flow|gt|label|mask|obj|occ|semantic|truth|viz)/i;
/** How deep folders are searched. */
const DEPTH = 4;

interface Folder {
    name: string;
    files: FileSystemFileEntry[];
    folders: FileSystemDirectoryEntry[];
}

/** The dropped files, and the name of their folder if there is one. Of folders with many frames, the first pair of frames. */
export async function dropped(transfer: DataTransfer): Promise<{ files: Named[]; folder: string | undefined }> {
    // Must be read before the first await, as the lists are cleared afterwards.
    const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry !== null && entry !== undefined);
    const plain = [...transfer.files];
    if (!entries.some((entry) => entry.isDirectory)) {
        return { files: plain.map(named), folder: undefined };
    }
    const read = await Promise.all(entries.filter(isFolder).map(listed));
    const top = [...entries.filter(isFile), ...read.flatMap(({ files }) => files)];
    const alone = read.length === 1 && top.some(isImage);
    const views = alone ? [] : (await Promise.all(read.map((folder) => deep(folder, DEPTH)))).flat();
    const [one, other] = views;
    const others = top.filter((file) => !isImage(file));
    const files = one && other ? [...first(one, other), ...others] : one ? [...new Set([...one.files, ...others])] : top;
    return { files: (await Promise.all(files.map(opened))).map(named), folder: entries.length === 1 ? entries[0]?.name : undefined };
}

export const named = (file: File): Named => ({ file, name: file.name || 'pasted image' });

const isFile = (entry: FileSystemEntry): entry is FileSystemFileEntry => entry.isFile;
const isFolder = (entry: FileSystemEntry): entry is FileSystemDirectoryEntry => entry.isDirectory;
const isImage = ({ name }: FileSystemEntry): boolean => IMAGE.test(name);
const opened = (entry: FileSystemFileEntry): Promise<File> => new Promise((resolve, reject) => entry.file(resolve, reject));

const { compare } = new Intl.Collator('en', { numeric: true });
const sorted = <T extends FileSystemEntry>(entries: T[]): T[] => entries.filter(({ name }) => !HIDDEN.test(name)).sort((a, b) => compare(a.name, b.name));

/** What a folder holds, sorted by name; the reader returns it in batches in any order. */
async function listed(folder: FileSystemDirectoryEntry): Promise<Folder> {
    const reader = folder.createReader();
    const all: FileSystemEntry[] = [];
    for (;;) {
        const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
        if (some.length === 0) {
            return { name: folder.name, files: sorted(all.filter(isFile)), folders: sorted(all.filter(isFolder)) };
        }
        all.push(...some);
    }
}

/** A folder and those below it, as far as they hold views. */
async function deep(folder: Folder, depth: number): Promise<Folder[]> {
    const below = depth > 0 ? await Promise.all(folder.folders.filter(({ name }) => !NO_VIEWS.test(name)).map(listed)) : [];
    return [...(folder.files.some(isImage) ? [folder] : []), ...(await Promise.all(below.map((one) => deep(one, depth - 1)))).flat()];
}

/** The first frames of two folders that have one name, or else the first of each. */
function first(...folders: [Folder, Folder]): FileSystemFileEntry[] {
    const [left, right] = folders.map(({ files }) => files.filter(isImage)) as [FileSystemFileEntry[], FileSystemFileEntry[]];
    const frame = left.find(({ name }) => right.some((file) => file.name === name)) ?? left[0];
    const its = right.find(({ name }) => name === frame?.name) ?? right[0];
    return [frame, its].filter((file) => file !== undefined);
}
