// The 3-D view of the surface of a map, in a separate chunk with three.js that is loaded on first use.

import {
    BufferAttribute,
    BufferGeometry,
    DoubleSide,
    Group,
    Mesh,
    PerspectiveCamera,
    Points,
    Scene,
    ShaderMaterial,
    Spherical,
    Vector3,
    WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { step } from './dom';
import { Recording } from './film';
import type { Mesh as Surface } from './mesh';
import type { Cameras } from './protocol';
import { calm } from './visitor';

// Lonely vertices are drawn as points of the size of their pixel at their depth.
const VERTEX = `
    attribute float confidence;
    uniform float least, footprint, projection;
    varying vec3 tint;
    varying float kept;
    void main() {
        tint = color;
        kept = confidence < least ? 0.0 : 1.0;
        vec4 seen = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * seen;
        gl_PointSize = clamp(footprint * position.z * projection / -seen.z, 1.0, 64.0);
    }`;
// A triangle is dropped with any of its corners.
const FRAGMENT = `
    varying vec3 tint;
    varying float kept;
    void main() {
        if (kept < 0.999) {
            discard;
        }
        gl_FragColor = vec4(tint, 1.0);
    }`;

/** Rotation per arrow key in degrees. */
const TURN = 5;
/** How long a new surface swings, how many times, and how far to each side. */
const SWING = { milliseconds: 16_000, times: 2, radians: 0.24 };
/** How long a film lasts, and how many times the surface swings in it, so that it can be played again and again. */
const FILM = { milliseconds: 6000, times: 1 };
/** After this many frames slower than this, the swinging stops, so that the page remains responsive. */
const SLOW = { milliseconds: 100, frames: 30 };

export class SurfaceView {
    private readonly renderer: WebGLRenderer;
    private readonly scene = new Scene();
    private readonly camera = new PerspectiveCamera();
    private readonly controls: OrbitControls;
    private readonly material = new ShaderMaterial({
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        vertexColors: true,
        side: DoubleSide,
        uniforms: { least: { value: 0 }, footprint: { value: 0 }, projection: { value: 0 } },
    });
    private shown: Group | undefined;
    private positions: BufferAttribute | undefined;
    private rig: { cameras: Cameras; width: number; height: number } | undefined;
    private due = 0;
    /** Whether the surface may swing: until the user first moves it. */
    private swings = !calm();

    /** `swinging` is called when the surface starts and stops swinging. Throws if the browser has no WebGL. */
    constructor(
        private readonly canvas: HTMLCanvasElement,
        private readonly swinging: (swings: boolean) => void,
    ) {
        const context = canvas.getContext('webgl2', { antialias: false, powerPreference: 'high-performance' });
        if (!context) {
            throw new Error('this browser offers no WebGL 2 here. Is hardware acceleration switched off in its settings?');
        }
        this.renderer = new WebGLRenderer({ canvas, context });
        this.renderer.setClearColor(0x14161a);
        this.controls = new OrbitControls(this.camera, canvas);
        this.controls.addEventListener('change', () => this.ask());
        this.controls.addEventListener('start', () => this.hold());
        canvas.addEventListener('keydown', (event) => this.press(event));
        new ResizeObserver(() => this.resize()).observe(canvas);
    }

    /** Shows another surface. The view is kept if size and cameras are the same. */
    show(surface: Surface, cameras: Cameras, width: number, height: number): void {
        this.clear();
        this.positions = new BufferAttribute(surface.positions, 3);
        const attributes = {
            position: this.positions,
            color: new BufferAttribute(surface.colours, 3, true),
            confidence: new BufferAttribute(surface.confidences, 1),
        };
        const [faces, lonely] = [surface.triangles, surface.lonely].map((index) => {
            const geometry = new BufferGeometry().setIndex(new BufferAttribute(index, 1));
            Object.entries(attributes).forEach(([name, attribute]) => geometry.setAttribute(name, attribute));
            return geometry;
        });
        this.shown = new Group();
        for (const part of [new Mesh(faces, this.material), new Points(lonely, this.material)]) {
            // The camera moves inside the surface, so culling it as a whole is pointless.
            part.frustumCulled = false;
            this.shown.add(part);
        }
        // Converts x right, y down, z forward to y up and z towards the viewer.
        this.shown.rotation.x = Math.PI;
        this.scene.add(this.shown);
        this.rig = { cameras, width, height };
        this.uniform('footprint', (1.2 * surface.step) / cameras.focalLength);
        this.reset();
        if (this.swings) {
            void this.swing();
        }
    }

    /** Swings the surface slowly from side to side to show its depth, until the user moves it or switches to another view. */
    private async swing(): Promise<void> {
        let [last, slow] = [performance.now(), 0];
        this.swinging(true);
        await this.sway(SWING.milliseconds, SWING.times, (now) => {
            slow += now - last > SLOW.milliseconds ? 1 : 0;
            last = now;
            return this.swings && slow < SLOW.frames && this.canvas.clientWidth > 0;
        });
        this.swings = false;
        this.swinging(false);
    }

    /** Films one swing from the current view, named `name`. Ends with an error if `signal` is aborted. */
    async film(name: string, signal: AbortSignal): Promise<File> {
        this.hold();
        const recording = new Recording(this.canvas);
        await this.sway(FILM.milliseconds, FILM.times, () => !signal.aborted && this.canvas.clientWidth > 0);
        const file = await recording.stop(name);
        signal.throwIfAborted();
        return file;
    }

    /** Moves the view to both sides and back, while `goesOn`. Ends early if another surface is shown. */
    private sway(milliseconds: number, times: number, goesOn: (now: number) => boolean): Promise<void> {
        const shown = this.shown;
        const begun = performance.now();
        const start = new Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
        return new Promise((resolve) => {
            const frame = (now: number) => {
                const part = Math.max(0, now - begun) / milliseconds;
                if (shown !== this.shown || !goesOn(now)) {
                    resolve();
                    return;
                }
                const theta = start.theta + SWING.radians * Math.sin(2 * Math.PI * times * Math.min(1, part));
                this.look(new Spherical(start.radius, start.phi, theta));
                if (part >= 1) {
                    resolve();
                    return;
                }
                requestAnimationFrame(frame);
            };
            requestAnimationFrame(frame);
        });
    }

    /** Stops the swinging for good. */
    private hold(): void {
        this.swings = false;
    }

    /** Looks at the target from this position. */
    private look(from: Spherical): void {
        this.camera.position.setFromSpherical(from).add(this.controls.target);
        this.controls.update();
        this.ask();
    }

    /** Frees the memory of the surface. */
    clear(): void {
        if (this.shown) {
            this.scene.remove(this.shown);
            this.shown.children.forEach((part) => (part as Mesh).geometry.dispose());
            this.shown = this.positions = undefined;
            this.renderer.renderLists.dispose();
            this.ask();
        }
    }

    /** Hides what is below this confidence. */
    atLeast(confidence: number): void {
        this.uniform('least', confidence);
        this.ask();
    }

    /** Restores the first view, without swinging. */
    rest(): void {
        this.hold();
        this.reset();
    }

    /** The view of the left camera, slightly from the side. */
    private reset(): void {
        if (!this.positions || !this.rig) {
            return;
        }
        const { cameras, width, height } = this.rig;
        const [, median, far] = depths(this.positions);
        const across = (pixel: number, centre: number) => ((pixel - centre) * median) / cameras.focalLength;
        this.controls.target.set(across((width - 1) / 2, cameras.cx), -across((height - 1) / 2, cameras.cy), -median);
        [this.camera.near, this.camera.far] = [median / 500, 20 * far];
        const offset = new Spherical(1.06 * median, Math.PI / 2 - 0.12, 0.26);
        this.camera.position.setFromSpherical(offset).add(this.controls.target);
        this.controls.update();
        this.resize();
    }

    private uniform(name: 'least' | 'footprint' | 'projection', value: number): void {
        const uniform = this.material.uniforms[name];
        if (uniform) {
            uniform.value = value;
        }
    }

    private resize(): void {
        const { clientWidth, clientHeight } = this.canvas;
        if (clientWidth === 0 || clientHeight === 0) {
            return;
        }
        this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
        this.renderer.setSize(clientWidth, clientHeight, false);
        this.camera.aspect = clientWidth / clientHeight;
        if (this.rig) {
            // Fits the field of view of the left camera, with a margin for the rotated view.
            const { cameras, width, height } = this.rig;
            const half = (1.12 * Math.max(height, width / this.camera.aspect)) / 2 / cameras.focalLength;
            this.camera.fov = (360 / Math.PI) * Math.atan(half);
            this.uniform('projection', this.renderer.domElement.height / 2 / half);
        }
        this.camera.updateProjectionMatrix();
        this.ask();
    }

    /** Requests one redraw in the next frame, however often it is called. */
    private ask(): void {
        this.due ||= requestAnimationFrame(() => {
            this.due = 0;
            this.renderer.render(this.scene, this.camera);
            this.canvas.dataset['drawn'] = String(Number(this.canvas.dataset['drawn'] ?? 0) + 1);
        });
    }

    private press(event: KeyboardEvent): void {
        this.hold();
        const { target } = this.controls;
        const offset = this.camera.position.clone().sub(target);
        const keys = step(event);
        if (keys && event.shiftKey) {
            // Moves in the screen plane, in proportion to the distance.
            const move = new Vector3(Math.sign(keys[0]), -Math.sign(keys[1]), 0).multiplyScalar(0.04 * offset.length());
            target.add(move.applyQuaternion(this.camera.quaternion));
        } else if (keys) {
            const angles = new Spherical().setFromVector3(offset);
            angles.theta -= (keys[0] * TURN * Math.PI) / 180;
            angles.phi -= (keys[1] * TURN * Math.PI) / 180;
            offset.setFromSpherical(angles.makeSafe());
        } else if (event.key === '+' || event.key === '=' || event.key === '-') {
            offset.multiplyScalar(event.key === '-' ? 1.15 : 1 / 1.15);
        } else if (event.key === 'Home') {
            event.preventDefault();
            this.reset();
            return;
        } else {
            return;
        }
        event.preventDefault();
        this.camera.position.copy(target).add(offset);
        this.controls.update();
        this.ask();
    }
}

/** The 5th, 50th and 95th percentile of the depths. */
function depths(positions: BufferAttribute): [number, number, number] {
    const every = Math.max(1, Math.floor(positions.count / 10_000));
    const some: number[] = [];
    for (let i = 0; i < positions.count; i += every) {
        some.push(positions.getZ(i));
    }
    some.sort((a, b) => a - b);
    const at = (part: number) => some[Math.floor(part * (some.length - 1))] ?? 1;
    return [at(0.05), at(0.5), at(0.95)];
}
