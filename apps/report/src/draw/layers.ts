// SPDX-License-Identifier: BSD-3-Clause
// The things that three.js draws.
import {
  BufferAttribute, BufferGeometry, DataTexture, FloatType, GLSL3, LineSegments, Mesh, NearestFilter, Points,
  RawShaderMaterial, RGBAFormat, type Material, type Object3D,
} from "three";
import {
  kAxesVertex, kLineFragment, kLineVertex, kPlainVertex, kPointFragment, kPointVertex, kTextureWidth,
} from "./shaders";

type Uniforms = Record<string, { value: unknown }>;

/** One texel a variable. */
export class StateTexture {
  readonly texture: DataTexture;
  private readonly data: Float32Array;

  constructor(private readonly count: number) {
    const height = Math.max(1, Math.ceil(count / kTextureWidth));
    this.data = new Float32Array(4 * kTextureWidth * height);
    this.texture = new DataTexture(this.data, kTextureWidth, height, RGBAFormat, FloatType);
    this.texture.minFilter = this.texture.magFilter = NearestFilter;
  }

  setPositions(xyz: Float32Array): this {
    for (let i = 0; i < this.count; ++i) {
      const there = Number.isFinite(xyz[3 * i] + xyz[3 * i + 1] + xyz[3 * i + 2]);
      this.data[4 * i] = there ? xyz[3 * i] : 0;
      this.data[4 * i + 1] = there ? xyz[3 * i + 1] : 0;
      this.data[4 * i + 2] = there ? xyz[3 * i + 2] : 0;
      this.data[4 * i + 3] = there ? 1 : 0;
    }
    this.texture.needsUpdate = true;
    return this;
  }

  /** Quaternions, or angles about z. */
  setOrientations(turns: Float32Array): this {
    const angles = turns.length === this.count;
    for (let i = 0; i < this.count; ++i) {
      const q = angles ? [0, 0, Math.sin(turns[i] / 2), Math.cos(turns[i] / 2)] : turns.subarray(4 * i, 4 * i + 4);
      for (let d = 0; d < 4; ++d) this.data[4 * i + d] = Number.isFinite(q[3]) ? q[d] : 0;
    }
    this.texture.needsUpdate = true;
    return this;
  }

  dispose(): void {
    this.texture.dispose();
  }
}

/** `opaque`: hides what is behind it. `through`: seen through everything. Neither: blended. */
type Depth = "opaque" | "blended" | "through";

function material(vertexShader: string, fragmentShader: string, uniforms: Uniforms, depth: Depth): RawShaderMaterial {
  return new RawShaderMaterial({
    glslVersion: GLSL3, vertexShader, fragmentShader, uniforms,
    transparent: depth !== "opaque", depthWrite: depth === "opaque", depthTest: depth !== "through",
  });
}

/** Vertices of a set of edges, shared by all estimates that draw it. */
export class EdgeBuffers {
  readonly edge: BufferAttribute;
  readonly value: BufferAttribute;
  readonly noArc: BufferAttribute;
  readonly quads: BufferAttribute;
  readonly lines: BufferAttribute;
  readonly count: number;

  constructor(a: Int32Array, b: Int32Array, readonly numbers: Int32Array, variables: number) {
    const count = (this.count = numbers.length);
    const edge = new Int32Array(12 * count);
    const quads = new Uint32Array(6 * count);
    const lines = new Uint32Array(2 * count);
    for (let k = 0; k < count; ++k) {
      if (a[k] >= variables || b[k] >= variables) throw new RangeError("edge out of range");
      for (let v = 0; v < 4; ++v) edge.set([a[k], b[k], numbers[k]], 12 * k + 3 * v);
      quads.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 2, 4 * k + 1, 4 * k + 3], 6 * k);
      lines[2 * k] = 4 * k;
      lines[2 * k + 1] = 4 * k + 2;
    }
    this.edge = new BufferAttribute(edge, 3);
    this.value = new BufferAttribute(new Float32Array(4 * count), 1);
    this.noArc = new BufferAttribute(new Uint8Array(8 * count), 2);
    this.quads = new BufferAttribute(quads, 1);
    this.lines = new BufferAttribute(lines, 1);
  }

  /** `fraction(e)`: the residual of edge number e, 0 … 1. */
  setValues(fraction: (e: number) => number): void {
    const values = this.value.array as Float32Array;
    for (let k = 0; k < this.count; ++k) values.fill(fraction(this.numbers[k]), 4 * k, 4 * k + 4);
    this.value.needsUpdate = true;
  }
}

/** One estimate's view of a set of edges: thick (triangles) or thin (lines). */
export class EdgeLayer {
  readonly thick: Mesh;
  readonly thin: LineSegments;
  readonly uniforms: Uniforms;
  private readonly geometries: BufferGeometry[] = [];

  constructor(readonly buffers: EdgeBuffers, shared: Uniforms, own: Uniforms, arcs: Float32Array | null, depth: Depth) {
    this.uniforms = { ...shared, ...own };
    const arc = arcs ? new BufferAttribute(perVertex(arcs), 2) : buffers.noArc;
    const geometry = (index: BufferAttribute) => {
      const all = new BufferGeometry();
      all.setAttribute("edge", buffers.edge).setAttribute("value", buffers.value).setAttribute("arc", arc);
      all.setIndex(index);
      this.geometries.push(all);
      return all;
    };
    const shader = material(kLineVertex, kLineFragment, this.uniforms, depth);
    this.thick = new Mesh(geometry(buffers.quads), shader);
    this.thin = new LineSegments(geometry(buffers.lines), shader);
    shader.side = 2;
    this.thick.frustumCulled = this.thin.frustumCulled = false;
  }

  /** Draws the last `count` edges of the order, so many that the worst are always among them. */
  show(how: "thick" | "thin" | "hidden", count = this.buffers.count): void {
    const n = Math.min(count, this.buffers.count);
    this.thick.visible = how === "thick" && n > 0;
    this.thin.visible = how === "thin" && n > 0;
    this.thick.geometry.setDrawRange(6 * (this.buffers.count - n), 6 * n);
    this.thin.geometry.setDrawRange(2 * (this.buffers.count - n), 2 * n);
  }

  get objects(): Object3D[] {
    return [this.thick, this.thin];
  }

  order(order: number): this {
    this.thick.renderOrder = this.thin.renderOrder = order;
    return this;
  }

  dispose(): void {
    for (const geometry of this.geometries) geometry.dispose();
    (this.thick.material as Material).dispose();
  }
}

function perVertex(arcs: Float32Array): Float32Array {
  const all = new Float32Array(4 * arcs.length);
  for (let k = 0; k < arcs.length / 2; ++k) {
    for (let v = 0; v < 4; ++v) all.set([arcs[2 * k], arcs[2 * k + 1]], 8 * k + 2 * v);
  }
  return all;
}

export function pointLayer(members: Int32Array, shared: Uniforms, own: Uniforms): Points {
  const geometry = new BufferGeometry();
  geometry.setAttribute("variable", new BufferAttribute(members, 1));
  geometry.setIndex(new BufferAttribute(Uint32Array.from(members.keys()), 1));
  const points = new Points(geometry, material(kPointVertex, kPointFragment, { ...shared, ...own }, "opaque"));
  points.frustumCulled = false;
  return points;
}

export function axesLayer(members: Int32Array, axes: 1 | 3, shared: Uniforms, own: Uniforms): LineSegments {
  const tip = new Int32Array(4 * axes * members.length);
  let k = 0;
  for (const variable of members) {
    for (let v = 0; v < 2 * axes; ++v) {
      tip[k++] = variable;
      tip[k++] = v;
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("tip", new BufferAttribute(tip, 2));
  geometry.setIndex(new BufferAttribute(Uint32Array.from({ length: tip.length / 2 }, (_, i) => i), 1));
  const lines = new LineSegments(geometry, material(kAxesVertex, kLineFragment, { ...shared, ...own }, "opaque"));
  lines.frustumCulled = false;
  return lines;
}

/** Lines whose points are given. `own` has viewProjection, colour, paper, alpha. */
export class PlainLines {
  readonly object: LineSegments;

  constructor(own: Uniforms) {
    const dash = { dash: { value: [0, 0, 0, 0] }, pixelsPerMetre: { value: 1 } };
    this.object = new LineSegments(new BufferGeometry(), material(kPlainVertex, kLineFragment, { ...own, ...dash }, "blended"));
    this.object.frustumCulled = false;
  }

  set(points: Float32Array): void {
    this.object.geometry.dispose();
    this.object.geometry = new BufferGeometry();
    this.object.geometry.setAttribute("position", new BufferAttribute(points, 3));
    this.object.visible = points.length > 0;
  }

  dispose(): void {
    this.object.geometry.dispose();
    (this.object.material as Material).dispose();
  }
}
