// Subscribes to a running sequence like Foxglove. scripts/viewer runs this in the folder with its packages.
import { spawn, spawnSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import foxglove from '@foxglove/ws-protocol';
import { parse } from '@foxglove/rosmsg';
import { MessageReader } from '@foxglove/rosmsg2-serialization';
import WebSocket from 'ws';

const { FoxgloveClient } = foxglove;
const { MRFGS } = process.env;
const [width, height, shift, most] = [240, 180, 12, 31];
const common = ['--method', 'fast', '--device', 'cpu', '--max-disparity', `${most}`, '--focal', '300', '--baseline', '0.12m', '--quiet'];
const work = mkdtempSync(join(tmpdir(), 'viewer-'));
process.on('exit', () => rmSync(work, { recursive: true, force: true }));

function check(what, holds) {
    if (!holds) {
        console.error(`viewer: ${what}`);
        process.exit(1);
    }
}

// Two views of a random plane: side by side as a stream has them, and as files.
let seed = 1;
const random = () => (seed = (seed * 48271) % 2147483647) % 256;
const wide = width + shift;
const texture = Uint8Array.from({ length: wide * height * 3 }, random);
const view = (from) => Buffer.concat(Array.from({ length: height }, (_, y) => texture.subarray(3 * (y * wide + from), 3 * (y * wide + from + width))));
const views = [view(0), view(shift)];
const row = (side, y) => views[side].subarray(3 * y * width, 3 * (y + 1) * width);
const frame = Buffer.concat(Array.from({ length: height }, (_, y) => Buffer.concat([row(0, y), row(1, y)])));
views.forEach((pixels, side) => writeFileSync(join(work, `${side}.ppm`), Buffer.concat([Buffer.from(`P6 ${width} ${height} 255\n`), pixels])));
const matched = spawnSync(MRFGS, ['match', join(work, '0.ppm'), join(work, '1.ppm'), join(work, 'map.pfm'), '--also', 'depth,points', ...common], { encoding: 'utf8' });
check(`match: ${matched.stderr}`, matched.status === 0);

// The values of a PFM file, which stores the last row first.
function pfm(name) {
    const file = readFileSync(join(work, name));
    const all = new Float32Array(new Uint8Array(file.subarray(file.length - 4 * width * height)).buffer);
    return Array.from({ length: height }, (_, y) => all.subarray((height - 1 - y) * width, (height - y) * width)).flatMap((row) => [...row]);
}
const points = +/element vertex (\d+)/.exec(readFileSync(join(work, 'map.points.ply'), 'latin1'))[1];
const expected = { disparity: pfm('map.pfm'), depth: pfm('map.depth.pfm') };
const floats = ({ data }) => new Float32Array(new Uint8Array(data).buffer);
const same = (found, wanted) => found.length === wanted.length && wanted.every((v, i) => !Number.isFinite(v) || Object.is(v, found[i]));

function started(address) {
    const child = spawn(MRFGS, ['sequence', '-', address, '--raw-frames', `${2 * width}x${height},rgb24`, '--also', 'depth,points', ...common.filter((word) => word !== '--quiet')]);
    const run = { child, said: '' };
    child.stderr.on('data', (data) => (run.said += data));
    run.ended = new Promise((resolve) => child.on('close', resolve));
    return run;
}

const run = started('ws://127.0.0.1:0');
run.child.stdin.on('error', () => {});
const feeding = setInterval(() => run.child.stdin.write(frame), 100);
const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
async function until(what, holds) {
    for (let i = 0; i < 300; i++) {
        if (holds()) {
            return;
        }
        await wait(100);
    }
    check(`timed out after 30 s waiting for ${what}; the program printed ${run.said}`, false);
}

await until('an address', () => /open (ws:\S+) in Foxglove/.test(run.said));
const [, address] = /open (ws:\S+) in Foxglove/.exec(run.said);

// Connects a viewer and checks the last message of each topic.
async function looked(Socket, protocols) {
    const client = new FoxgloveClient({ ws: new Socket(address, protocols) });
    const [channels, readers, found] = [new Map(), new Map(), new Map()];
    client.on('error', (error) => check(`a viewer: ${error.message}`, false));
    client.on('advertise', (told) => told.forEach((channel) => {
        channels.set(client.subscribe(channel.id), channel);
        readers.set(channel.topic, new MessageReader(parse(channel.schema, { ros2: true })));
    }));
    client.on('message', ({ subscriptionId, data }) => {
        const { topic } = channels.get(subscriptionId);
        found.set(topic, readers.get(topic).readMessage(data));
    });
    const topics = ['/disparity', '/left/camera_info', '/depth/image_rect', '/points2'];
    await until('all topics', () => topics.every((topic) => found.has(topic)));
    const disparity = found.get('/disparity');
    check('the bits of the disparities', same(floats(disparity.image), expected.disparity));
    const changed = Float32Array.from(expected.disparity);
    changed[7] += 1;
    check('control: another disparity shows', !same(floats(disparity.image), [...changed]));
    check('focal length and baseline', disparity.f === 300 && Math.abs(disparity.t - 0.12) < 1e-6);
    check('the bits of the depths', same(floats(found.get('/depth/image_rect')), expected.depth));
    check('points', found.get('/points2').width === points && points > 0.8 * width * height);
    check('the camera', found.get('/left/camera_info').p[0] === 300);
    client.close();
}

await looked(WebSocket, ['foxglove.sdk.v1']);
await looked(WebSocket, ['foxglove.websocket.v1']);
// A client that stops reading does not hold up others, and an unknown subprotocol is refused.
const idle = new WebSocket(address, ['foxglove.sdk.v1']);
await new Promise((resolve) => idle.on('open', resolve));
idle._socket.pause();
const other = new WebSocket(address, ['chat']);
await new Promise((resolve) => other.on('error', resolve));
await looked(WebSocket, ['foxglove.sdk.v1']);
// A port that is in use.
const taken = started(address);
taken.child.stdin.on('error', () => {});
taken.child.stdin.write(frame);
taken.child.stdin.end();
check('a port that is taken', (await taken.ended) === 1 && /^mrfgs: cannot write ws:.*in use/m.test(taken.said));
clearInterval(feeding);
run.child.stdin.end();
check(`the end: ${run.said}`, (await run.ended) === 0 && / frames of 240 x 180/.test(run.said));
console.log('viewer: disparities, depths and points are identical to those of match, with both versions of the protocol');
process.exit(0);
