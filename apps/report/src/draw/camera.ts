// SPDX-License-Identifier: BSD-3-Clause
// Where the eye is: a target, two angles and a distance; the same state for plans (straight down, without
// perspective) and for space. Pure state; `scene.ts` applies it to three.js cameras.
import { Matrix4, OrthographicCamera, PerspectiveCamera, Vector3, type Camera } from "three";

export interface Eye {
  target: [number, number, number];
  /** Angle about z, 0: looking along +y [rad]. */
  yaw: number;
  /** Above the horizon; π/2: straight down [rad]. */
  pitch: number;
  /** From target to eye [m]; in a plan the same height of the view as at that distance. */
  distance: number;
}

const kFieldOfView = 35;  // degrees, vertical
const kTan = Math.tan((kFieldOfView / 2) * (Math.PI / 180));
const kSteepest = Math.PI / 2;
const kFitPoints = 5000;

export interface Box {
  min: [number, number, number];
  max: [number, number, number];
}

/** Of all finite points; a metre about the origin if there are none. */
export function boundingBox(clouds: Float32Array[]): Box {
  const min: Box["min"] = [Infinity, Infinity, Infinity];
  const max: Box["max"] = [-Infinity, -Infinity, -Infinity];
  for (const cloud of clouds) {
    for (let i = 0; i < cloud.length; i += 3) {
      if (!Number.isFinite(cloud[i] + cloud[i + 1] + cloud[i + 2])) continue;
      for (let d = 0; d < 3; ++d) {
        if (cloud[i + d] < min[d]) min[d] = cloud[i + d];
        if (cloud[i + d] > max[d]) max[d] = cloud[i + d];
      }
    }
  }
  return min[0] > max[0] ? { min: [-1, -1, 0], max: [1, 1, 0] } : { min, max };
}

export class EyeControl {
  eye: Eye = { target: [0, 0, 0], yaw: 0, pitch: kSteepest, distance: 10 };
  width = 1;
  height = 1;
  private size = 10;  // of what there is to see [m]
  private readonly perspective = new PerspectiveCamera(kFieldOfView, 1, 0.1, 1e4);
  private readonly orthographic = new OrthographicCamera();

  constructor(public plan: boolean) {
    this.perspective.up.set(0, 0, 1);
  }

  /** Metres that a pixel covers at the target. */
  get metresPerPixel(): number {
    return (2 * this.eye.distance * kTan) / this.height;
  }

  /** Shows all of the points, from the direction in which the eye is. */
  fitting(clouds: Float32Array[], yaw = this.eye.yaw, pitch = this.eye.pitch): Eye {
    const box = boundingBox(clouds);
    const target = box.min.map((low, d) => 0.5 * (low + box.max[d])) as Eye["target"];
    const { right, up, forward } = axes(yaw, pitch);
    const along = (axis: Axis, p: Float32Array, i: number) =>
      axis[0] * (p[i] - target[0]) + axis[1] * (p[i + 1] - target[1]) + axis[2] * (p[i + 2] - target[2]);
    const margin = 1.14;
    const aspect = this.width / this.height;
    let distance = 1e-3;
    for (const cloud of clouds) {
      const stride = 3 * Math.max(1, Math.floor(cloud.length / 3 / kFitPoints));
      for (let i = 0; i < cloud.length; i += stride) {
        const reach = Math.max(Math.abs(along(up, cloud, i)), Math.abs(along(right, cloud, i)) / aspect);
        const nearer = this.plan ? 0 : along(forward, cloud, i);
        const needed = (margin * reach) / kTan - nearer;
        if (needed > distance) distance = needed;  // false for NaN
      }
    }
    return { target, yaw, pitch, distance };
  }

  /** How large what there is to see is; zooming ends far from that [m]. */
  setSize(box: Box): void {
    this.size = Math.max(Math.hypot(...box.max.map((x, d) => x - box.min[d])), 1e-3);
  }

  orbit(dx: number, dy: number): void {
    if (this.plan) return this.pan(dx, dy);
    this.eye.yaw -= dx * 0.006;
    this.eye.pitch = Math.min(kSteepest, Math.max(-kSteepest, this.eye.pitch + dy * 0.006));
  }

  /** By pixels: what is under the pointer stays there. */
  pan(dx: number, dy: number): void {
    const { right, up } = axes(this.eye.yaw, this.eye.pitch);
    const scale = this.metresPerPixel;
    for (let d = 0; d < 3; ++d) this.eye.target[d] += scale * (-dx * right[d] + dy * up[d]);
  }

  /** By a factor (below 1: nearer), keeping what is at pixel x, y (in the plane of the target) in its place. */
  zoom(factor: number, x = this.width / 2, y = this.height / 2): void {
    const before = this.metresPerPixel;
    this.eye.distance = Math.min(50 * this.size, Math.max(1e-5 * this.size, this.eye.distance * factor));
    const change = before - this.metresPerPixel;
    const { right, up } = axes(this.eye.yaw, this.eye.pitch);
    const px = x - this.width / 2, py = this.height / 2 - y;
    for (let d = 0; d < 3; ++d) this.eye.target[d] += change * (px * right[d] + py * up[d]);
  }

  camera(): Camera {
    const { right, up, forward } = axes(this.eye.yaw, this.eye.pitch);
    const aspect = this.width / this.height;
    const distance = this.eye.distance;
    const camera = this.plan ? this.orthographic : this.perspective;
    const reach = Math.max(this.size, distance);
    if (camera === this.perspective) {
      this.perspective.aspect = aspect;
      this.perspective.near = Math.max(distance * 0.01, 1e-4 * reach);
      this.perspective.far = distance + 4 * reach;
    } else {
      const h = distance * kTan;
      Object.assign(this.orthographic, { left: -h * aspect, right: h * aspect, top: h, bottom: -h, near: -4 * reach, far: 4 * reach });
    }
    const rotation = new Matrix4().makeBasis(
      new Vector3(...right), new Vector3(...up), new Vector3(-forward[0], -forward[1], -forward[2]));
    camera.quaternion.setFromRotationMatrix(rotation);
    const t = this.eye.target;
    const back = this.plan ? 0 : distance;
    camera.position.set(t[0] - back * forward[0], t[1] - back * forward[1], t[2] - back * forward[2]);
    camera.updateMatrixWorld(true);
    (camera as PerspectiveCamera | OrthographicCamera).updateProjectionMatrix();
    return camera;
  }
}

type Axis = [number, number, number];

/** Right, up and forward of an eye that looks along +y at yaw 0 and pitch 0. */
export function axes(yaw: number, pitch: number): { right: Axis; up: Axis; forward: Axis } {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return {
    right: [cy, sy, 0],
    up: [-sy * sp, cy * sp, cp],
    forward: [-sy * cp, cy * cp, -sp],
  };
}

/** Between two eyes, the short way round; distances geometrically. */
export function between(from: Eye, to: Eye, t: number): Eye {
  const s = t * t * (3 - 2 * t);
  const turn = ((((to.yaw - from.yaw) % (2 * Math.PI)) + 3 * Math.PI) % (2 * Math.PI)) - Math.PI;
  return {
    target: from.target.map((x, d) => x + s * (to.target[d] - x)) as Eye["target"],
    yaw: from.yaw + s * turn,
    pitch: from.pitch + s * (to.pitch - from.pitch),
    distance: from.distance * (to.distance / from.distance) ** s,
  };
}
