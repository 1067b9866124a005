// Lets a test match the scene in the page, and returns the bytes of the maps.
import { createMatcher, type Options } from '@mrfgs/wasm';

async function bitmap(url: string): Promise<ImageBitmap> {
    return createImageBitmap(await (await fetch(url)).blob(), { colorSpaceConversion: 'none', premultiplyAlpha: 'none' });
}

async function match(device: NonNullable<Options['device']>) {
    const matcher = await createMatcher({ device });
    const views = [await bitmap('scene/im0.png'), await bitmap('scene/im1.png')] as const;
    const found = await matcher.match(...views, { minDisparity: 0, maxDisparity: 47 });
    matcher.close();
    const bytes = (array: Float32Array | Uint8Array) => [...new Uint8Array(array.buffer)];
    return { device: matcher.device, note: matcher.note, disparity: bytes(found.disparity), reasons: bytes(found.reasons) };
}

Object.assign(window, { match });
document.title = 'ready';
