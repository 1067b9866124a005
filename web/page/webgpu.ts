// What to do without WebGPU.

const SAME = 'The CPU path is used: the same maps, bit for bit. It starts with the preset for speed, fast.';

/** Why this browser cannot use the GPU, with the remedy. */
export function withoutWebGpu(): string {
    if (!isSecureContext) {
        return `WebGPU needs a secure page (https, or localhost). ${SAME}`;
    }
    if (!('gpu' in navigator)) {
        return `This browser has no WebGPU. Chrome and Edge have it from version 113 (Android 121), Safari from 26, Firefox from 141 on Windows and 145 on macOS. On Linux, switch it on: chrome://flags/#enable-unsafe-webgpu, or dom.webgpu.enabled in about:config. ${SAME}`;
    }
    return `WebGPU offers no device here. See that hardware acceleration is on in the settings; chrome://gpu or about:support tell more. On Linux, chrome://flags/#enable-unsafe-webgpu may show one. ${SAME}`;
}
