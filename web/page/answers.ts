// What workers share that answer calls with what the engine gives.

/** The memory of all arrays in a value: it moves instead of being copied. */
export function buffers(value: unknown): ArrayBuffer[] {
    if (ArrayBuffer.isView(value)) {
        return [value.buffer as ArrayBuffer];
    }
    return value && typeof value === 'object' ? [...new Set(Object.values(value).flatMap(buffers))] : [];
}

/** The engine's arrays are copies of their own, never views of its memory. */
export function own(array: Float32Array): Float32Array<ArrayBuffer>;
export function own(array: Uint8Array): Uint8Array<ArrayBuffer>;
export function own(array: Float32Array | Uint8Array): Float32Array | Uint8Array {
    return array;
}

/** A trap leaves the engine's memory as it was in mid-work: nothing can be trusted after it. */
export function broken(error: unknown): boolean {
    return error instanceof WebAssembly.RuntimeError || error instanceof RangeError || error instanceof InternalError();
}

/** Firefox's own, which ends what takes too much stack; elsewhere a class that nothing is of. */
function InternalError(): new () => object {
    return (globalThis as unknown as { InternalError?: new () => object }).InternalError ?? class {};
}

export const words = (error: unknown) => (error instanceof Error ? error.message : String(error));
