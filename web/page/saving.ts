// The file formats of results.

import type { Client } from './client';
import type { Cameras, Output, Picture, Result } from './protocol';
import { save } from './save';

/** The files that can be saved: those of the engine, and those made from its maps. */
export type File = Output | 'ply' | 'mesh' | 'glb';

const BINARY = 'application/octet-stream';

/** Saves a file of the result, prefixed with `name`. Points and meshes need cameras, and are filtered by confidence. */
export async function saveFile(
    client: Client,
    file: File,
    name: string,
    result: Result,
    left: Picture,
    cameras: Cameras | undefined,
    leastConfidence: number,
): Promise<void> {
    if (file === 'ply' || file === 'mesh' || file === 'glb') {
        if (!cameras) {
            throw new Error('Points and meshes need camera values. Enter them in the tab Surface.');
        }
        if (file === 'ply') {
            save(await client.call('ply', cameras, leastConfidence), `${name}-points.ply`, BINARY);
            return;
        }
        const { mesh, glb, ply } = await import('./mesh');
        const made = mesh(result, cameras, left, leastConfidence);
        if (file === 'mesh') {
            save(ply(made), `${name}-mesh.ply`, BINARY);
        } else {
            save(glb(made, await png(left)), `${name}.glb`, 'model/gltf-binary');
        }
        return;
    }
    const of = file === 'pfm' || file === 'png' ? 'disparity' : file;
    const [type, end] = file === 'pfm' || file === 'raw' ? [BINARY, 'pfm'] : ['image/png', 'png'];
    save(await client.call('file', file), `${name}-${of}.${end}`, type);
}

async function png({ width, height, pixels }: Picture): Promise<Uint8Array> {
    const canvas = new OffscreenCanvas(width, height);
    canvas.getContext('2d')?.putImageData(new ImageData(pixels, width, height), 0, 0);
    return new Uint8Array(await (await canvas.convertToBlob({ type: 'image/png' })).arrayBuffer());
}
