// Shared by the workers: conversion of results of the engine to replies.

/** The buffers of all arrays in a value, to be transferred instead of copied. */
export function buffers(value: unknown): ArrayBuffer[] {
    if (ArrayBuffer.isView(value)) {
        return [value.buffer as ArrayBuffer];
    }
    return value && typeof value === 'object' ? [...new Set(Object.values(value).flatMap(buffers))] : [];
}

/** The engine returns copies of its arrays, never views of its memory. */
export function own(array: Float32Array): Float32Array<ArrayBuffer>;
export function own(array: Uint8Array): Uint8Array<ArrayBuffer>;
export function own(array: Float32Array | Uint8Array): Float32Array | Uint8Array {
    return array;
}

/** After a trap the memory of the engine is in an undefined state, and the engine must not be used again. */
export function broken(error: unknown): boolean {
    return error instanceof WebAssembly.RuntimeError || error instanceof RangeError || error instanceof InternalError();
}

/** Firefox throws it when the stack overflows; elsewhere a class without instances stands in. */
function InternalError(): new () => object {
    return (globalThis as unknown as { InternalError?: new () => object }).InternalError ?? class {};
}

export const words = (error: unknown) => (error instanceof Error ? error.message : String(error));
