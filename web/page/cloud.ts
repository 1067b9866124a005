// The 3-D view of the points, in a separate chunk with three.js that is loaded on first use.

import {
    BufferAttribute,
    BufferGeometry,
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
import type { Cameras, Cloud } from './protocol';
import { calm } from './visitor';

// Points have the size of their pixel at their depth, so that surfaces seen from the front have no holes.
const VERTEX = `
    attribute float confidence;
    uniform float least, footprint, projection;
    varying vec3 tint;
    void main() {
        tint = color;
        vec4 seen = modelViewMatrix * vec4(position, 1.0);
        gl_Position = projectionMatrix * seen;
        gl_PointSize = clamp(footprint * position.z * projection / -seen.z, 1.0, 64.0);
        if (confidence < least) {
            gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
        }
    }`;
const FRAGMENT = `
    varying vec3 tint;
    void main() {
        gl_FragColor = vec4(tint, 1.0);
    }`;

/** Rotation per arrow key in degrees. */
const TURN = 5;
/** How long new points swing, how many times, and how far to each side. */
const SWING = { milliseconds: 16_000, times: 2, radians: 0.24 };
/** After this many frames slower than this, the swinging stops, so that the page remains responsive. */
const SLOW = { milliseconds: 100, frames: 30 };

export class CloudView {
    private readonly renderer: WebGLRenderer;
    private readonly scene = new Scene();
    private readonly camera = new PerspectiveCamera();
    private readonly controls: OrbitControls;
    private readonly material = new ShaderMaterial({
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        vertexColors: true,
        uniforms: { least: { value: 0 }, footprint: { value: 0 }, projection: { value: 0 } },
    });
    private points: Points | undefined;
    private rig: { cameras: Cameras; width: number; height: number } | undefined;
    private due = 0;
    /** Whether the points may swing: until the user first moves them. */
    private swings = !calm();

    /** `swinging` is called when the points start and stop swinging. Throws if the browser has no WebGL. */
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

    /** Shows other points. The view is kept if size and cameras are the same. */
    show(cloud: Cloud, cameras: Cameras, width: number, height: number): void {
        this.clear();
        const geometry = new BufferGeometry();
        geometry.setAttribute('position', new BufferAttribute(cloud.positions, 3));
        geometry.setAttribute('color', new BufferAttribute(cloud.colours, 3, true));
        geometry.setAttribute('confidence', new BufferAttribute(cloud.confidences, 1));
        this.points = new Points(geometry, this.material);
        // The camera moves inside the cloud, so culling it as a whole is pointless.
        this.points.frustumCulled = false;
        // Converts x right, y down, z forward to y up and z towards the viewer.
        this.points.rotation.x = Math.PI;
        this.scene.add(this.points);
        this.rig = { cameras, width, height };
        this.uniform('footprint', 1.2 / cameras.focalLength);
        this.reset();
        if (this.swings) {
            this.swing(performance.now());
        }
    }

    /** Swings the points slowly from side to side to show their depth, until the user moves them or switches to another view. */
    private swing(begun: number): void {
        const points = this.points;
        const start = new Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target));
        this.swinging(true);
        let [last, slow] = [begun, 0];
        const frame = (now: number) => {
            const part = (now - begun) / SWING.milliseconds;
            slow += now - last > SLOW.milliseconds ? 1 : 0;
            last = now;
            this.swings &&= part < 1 && slow < SLOW.frames;
            if (points !== this.points) {
                return;
            }
            if (!this.swings || this.canvas.clientWidth === 0) {
                this.swinging(false);
                return;
            }
            const theta = start.theta + SWING.radians * Math.sin(2 * Math.PI * SWING.times * Math.max(0, part));
            this.look(new Spherical(start.radius, start.phi, theta));
            requestAnimationFrame(frame);
        };
        requestAnimationFrame(frame);
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

    /** Frees the memory of the points. */
    clear(): void {
        if (this.points) {
            this.scene.remove(this.points);
            this.points.geometry.dispose();
            this.points = undefined;
            this.renderer.renderLists.dispose();
            this.ask();
        }
    }

    /** Hides points below this confidence. */
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
        if (!this.points || !this.rig) {
            return;
        }
        const { cameras, width, height } = this.rig;
        const [, median, far] = depths(this.points.geometry.getAttribute('position') as BufferAttribute);
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
