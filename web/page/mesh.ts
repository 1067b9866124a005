// The surface of a map as triangles, and its files. A separate chunk, loaded on first use.

import type { Cameras, Picture } from './protocol';
import { place } from './ruler';

export interface Mesh {
    /** x right, y down, z forward of the left camera, in the unit of the baseline. */
    positions: Float32Array<ArrayBuffer>;
    /** Texture coordinates in the left view, 0 to 1. */
    texture: Float32Array<ArrayBuffer>;
    colours: Uint8Array<ArrayBuffer>;
    /** 0 where the disparity is filled. */
    confidences: Uint8Array<ArrayBuffer>;
    /** Number of vertices that were measured. */
    measured: number;
    /** Three vertices each, counter-clockwise as seen by the camera. */
    triangles: Uint32Array<ArrayBuffer>;
    /** Vertices without a triangle, such as those of a wire. */
    lonely: Uint32Array<ArrayBuffer>;
    /** Every how many pixels there is a vertex, in rows and columns. */
    step: number;
    unit: string;
}

/** The maps that a mesh is made of. */
export interface Maps {
    width: number;
    height: number;
    disparity: Float32Array;
    confidence: Uint8Array;
    /** 0 where a disparity was measured and is reliable. */
    validity: Uint8Array;
}

/** Largest number of vertices; larger maps are subsampled. */
const MOST = 1_000_000;

/** Largest difference of joined disparities, in pixels per pixel of distance. A steep floor stays whole, and depth edges stay open. */
const STEEPEST = 2;

/** A mesh of the pixels of at least this confidence: with 0, of the filled ones too. Neighbours of similar disparity are joined. */
export function mesh({ width, height, disparity, confidence, validity }: Maps, cameras: Cameras, left: Picture, least: number): Mesh {
    const step = Math.ceil(Math.sqrt((width * height) / MOST));
    const [columns, rows] = [Math.ceil(width / step), Math.ceil(height / step)];
    const vertex = new Int32Array(columns * rows).fill(-1);
    // Infinity without a vertex, which is too far from all others to be joined.
    const seen = new Float32Array(columns * rows).fill(Infinity);
    const positions = new Float32Array(3 * columns * rows);
    const texture = new Float32Array(2 * columns * rows);
    const colours = new Uint8Array(3 * columns * rows);
    const confidences = new Uint8Array(columns * rows);
    let [count, measured] = [0, 0];
    for (let at = 0; at < vertex.length; at += 1) {
        const [x, y] = [step * (at % columns), step * Math.floor(at / columns)];
        const i = y * width + x;
        const filled = validity[i] !== 0;
        const sure = filled ? 0 : (confidence[i] ?? 0);
        const point = sure >= least ? place({ x, y }, disparity[i] ?? Infinity, cameras) : undefined;
        if (point) {
            positions.set(point, 3 * count);
            texture.set([(x + 0.5) / width, (y + 0.5) / height], 2 * count);
            colours.set(left.pixels.subarray(4 * i, 4 * i + 3), 3 * count);
            confidences[count] = sure;
            measured += filled ? 0 : 1;
            seen[at] = disparity[i] ?? 0;
            vertex[at] = count;
            count += 1;
        }
    }
    const triangles = new Uint32Array(6 * columns * rows);
    const joined = new Uint8Array(count);
    let length = 0;
    const join = (...corners: [number, number, number]) => {
        const of = corners.map((at) => seen[at] ?? Infinity);
        if (Math.max(...of) - Math.min(...of) <= STEEPEST * step) {
            for (const at of corners) {
                const corner = vertex[at] ?? 0;
                triangles[length] = corner;
                joined[corner] = 1;
                length += 1;
            }
        }
    };
    const apart = (a: number, b: number) => Math.abs((seen[a] ?? Infinity) - (seen[b] ?? Infinity));
    for (let row = 0; row + 1 < rows; row += 1) {
        for (let column = 0; column + 1 < columns; column += 1) {
            const a = row * columns + column;
            const [b, c, d] = [a + 1, a + columns, a + columns + 1];
            // Splits along the flatter diagonal.
            if (apart(a, d) <= apart(b, c)) {
                join(a, c, d);
                join(a, d, b);
            } else {
                join(a, c, b);
                join(b, c, d);
            }
        }
    }
    return {
        positions: positions.slice(0, 3 * count),
        texture: texture.slice(0, 2 * count),
        colours: colours.slice(0, 3 * count),
        confidences: confidences.slice(0, count),
        measured,
        triangles: triangles.slice(0, length),
        lonely: Uint32Array.from(joined.keys()).filter((of) => joined[of] === 0),
        step,
        unit: cameras.unit,
    };
}

/** Metres per unit, as glTF uses metres. */
const METRES: Record<string, number> = { mm: 1e-3, cm: 1e-2, m: 1 };

/** The mesh textured with the left view (PNG), as binary glTF 2.0: y up, z towards the viewer. */
export function glb({ positions, texture, triangles, unit }: Mesh, image: Uint8Array): Uint8Array<ArrayBuffer> {
    const scale = METRES[unit] ?? 1;
    const turned = positions.map((value, i) => (i % 3 === 0 ? scale * value : -scale * value));
    const [min, max] = [new Array<number>(3).fill(Infinity), new Array<number>(3).fill(-Infinity)];
    turned.forEach((value, i) => {
        min[i % 3] = Math.min(min[i % 3] ?? value, value);
        max[i % 3] = Math.max(max[i % 3] ?? value, value);
    });
    const parts = [turned, texture, triangles, image].map((part) => new Uint8Array(part.buffer, part.byteOffset, part.byteLength));
    let offset = 0;
    const bufferViews = parts.map(({ byteLength }, i) => {
        const view = { buffer: 0, byteOffset: offset, byteLength, ...(i < 3 && { target: i < 2 ? 34962 : 34963 }) };
        offset += Math.ceil(byteLength / 4) * 4;
        return view;
    });
    const text = JSON.stringify({
        asset: { version: '2.0', generator: 'mrfgs' },
        extensionsUsed: ['KHR_materials_unlit'],
        scene: 0,
        scenes: [{ nodes: [0] }],
        nodes: [{ mesh: 0 }],
        meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
        materials: [{ doubleSided: true, extensions: { KHR_materials_unlit: {} }, pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 } }],
        textures: [{ source: 0 }],
        images: [{ bufferView: 3, mimeType: 'image/png' }],
        accessors: [
            { bufferView: 0, componentType: 5126, count: turned.length / 3, type: 'VEC3', min, max },
            { bufferView: 1, componentType: 5126, count: texture.length / 2, type: 'VEC2' },
            { bufferView: 2, componentType: 5125, count: triangles.length, type: 'SCALAR' },
        ],
        bufferViews,
        buffers: [{ byteLength: offset }],
    });
    const json = new TextEncoder().encode(text.padEnd(Math.ceil(text.length / 4) * 4));
    const file = new Uint8Array(12 + 8 + json.length + 8 + offset);
    const words = new DataView(file.buffer);
    [0x46546c67, 2, file.length, json.length, 0x4e4f534a].forEach((word, i) => words.setUint32(4 * i, word, true));
    file.set(json, 20);
    [offset, 0x004e4942].forEach((word, i) => words.setUint32(20 + json.length + 4 * i, word, true));
    parts.forEach((part, i) => file.set(part, 28 + json.length + (bufferViews[i]?.byteOffset ?? 0)));
    return file;
}

/** The mesh with vertex colours, as binary PLY. */
export function ply({ positions, colours, triangles }: Mesh): Uint8Array<ArrayBuffer> {
    const [vertices, faces] = [positions.length / 3, triangles.length / 3];
    const header = new TextEncoder().encode(
        `ply\nformat binary_little_endian 1.0\ncomment mrfgs\nelement vertex ${vertices}\n` +
            'property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n' +
            `element face ${faces}\nproperty list uchar uint vertex_indices\nend_header\n`,
    );
    const file = new Uint8Array(header.length + 15 * vertices + 13 * faces);
    const words = new DataView(file.buffer);
    file.set(header);
    for (let i = 0, at = header.length; i < vertices; i += 1, at += 15) {
        for (let k = 0; k < 3; k += 1) {
            words.setFloat32(at + 4 * k, positions[3 * i + k] ?? 0, true);
            file[at + 12 + k] = colours[3 * i + k] ?? 0;
        }
    }
    for (let i = 0, at = header.length + 15 * vertices; i < faces; i += 1, at += 13) {
        file[at] = 3;
        for (let k = 0; k < 3; k += 1) {
            words.setUint32(at + 1 + 4 * k, triangles[3 * i + k] ?? 0, true);
        }
    }
    return file;
}
