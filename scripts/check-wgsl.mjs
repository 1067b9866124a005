// Compiles the shaders in a folder (NUMBER.STAGE.ENTRY-POINT.wgsl) with Dawn; run by scripts/check-wgsl, which installs Dawn.
import { readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';
import { create, globals } from 'webgpu';

Object.assign(globalThis, globals);
// The null backend validates everything and runs nothing.
const gpu = create(['backend=null']);
const device = await (await gpu.requestAdapter()).requestDevice();

// The fault of a shader, or null.
async function fault(code, entryPoint) {
    device.pushErrorScope('validation');
    const module = device.createShaderModule({ code });
    const { messages } = await module.getCompilationInfo();
    const error = messages.find((message) => message.type === 'error');
    if (!error) {
        device.createComputePipeline({ layout: 'auto', compute: { module, entryPoint } });
    }
    const refused = await device.popErrorScope();
    if (error) {
        return `line ${error.lineNum}: ${error.message}`;
    }
    return refused && refused.message.split('\n')[0];
}

function end(message, status) {
    (status ? console.error : console.log)(message);
    // Dawn keeps the process alive.
    process.exit(status);
}

// Controls: naga accepts both broken shaders; the second exceeds WebGPU's limit of invocations by one.
const main = (size, body) => `@compute @workgroup_size(${size}) fn main() { ${body} }`;
if (await fault(main(256, 'let a = true || (true && false);'), 'main')) {
    end('check-wgsl: a valid shader was rejected', 1);
}
for (const broken of [main(256, 'let a = true || true && false;'), main(257, '')]) {
    if (!(await fault(broken, 'main'))) {
        end(`check-wgsl: a broken shader went unnoticed: ${broken}`, 1);
    }
}

const folder = process.argv[2];
const files = readdirSync(folder).sort();
if (files.length === 0) {
    end(`check-wgsl: there are no shaders in ${folder}`, 1);
}
let failed = false;
for (const file of files) {
    const [, stage, entry] = file.split('.');
    const found = await fault(readFileSync(join(folder, file), 'utf8'), entry);
    if (found) {
        console.error(`shaders/${stage}.wgsl, ${entry}: ${found} (in ${join(folder, file)})`);
        failed = true;
    }
}
end(`${files.length} variants: ${failed ? 'not all are valid' : 'all valid'}`, failed ? 1 : 0);
