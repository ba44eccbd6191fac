// SPDX-License-Identifier: BSD-3-Clause
// Positions live in textures, one texel a variable (w: 1 there, 0 not), so that another estimate or the next frame of a
// recording is one small upload, and lines, points and axes never change. Two textures and `blend` between them
// make a recording glide.

export const kTextureWidth = 2048;

const kPositions = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D from;
uniform sampler2D to;
uniform float blend;
uniform mat4 viewProjection;
uniform vec2 viewport;      // in pixels of the canvas
uniform vec2 depthRange;    // [m] from the eye: where fading begins and ends; equal: no fading
uniform float fadeMost;

vec4 positionOf(int i) {
  ivec2 texel = ivec2(i & ${kTextureWidth - 1}, i >> ${Math.log2(kTextureWidth)});
  vec4 a = texelFetch(from, texel, 0);
  if (blend <= 0.0) return a;
  vec4 b = texelFetch(to, texel, 0);
  if (a.w < 0.5) return b;
  return b.w < 0.5 ? a : mix(a, b, blend);
}

float fading(float depth) {
  float span = depthRange.y - depthRange.x;
  return span <= 0.0 ? 0.0 : fadeMost * clamp((depth - depthRange.x) / span, 0.0, 1.0);
}

const vec4 kNowhere = vec4(2.0, 2.0, 2.0, 1.0);
`;

const kRamp = /* glsl */ `
uniform vec3 stops[5];
vec3 ramp(float t) {
  float x = clamp(t, 0.0, 1.0) * 4.0;
  int k = min(3, int(x));
  return mix(stops[k], stops[k + 1], x - float(k));
}
`;

/**
 * An edge is four vertices: two at each end. As two triangles it has a width in pixels; as a line between vertices 0
 * and 2 with width 0 it is as thin and as quick as can be.
 */
export const kLineVertex = /* glsl */ `${kPositions}${kRamp}
in ivec3 edge;      // variables a and b, number of the edge
in float value;     // residual, 0 … 1
in vec2 arc;        // along the trajectory, at a and at b [m]
uniform vec2 width;         // least and worst residual [px]
uniform vec3 colour;
uniform bool byResidual;
uniform int edgesShown;
out vec3 tint;
out float along;
out float faded;

void main() {
  vec4 a = positionOf(edge.x);
  vec4 b = positionOf(edge.y);
  gl_Position = kNowhere;
  if (a.w < 0.5 || b.w < 0.5 || edge.z >= edgesShown) return;
  vec4 p = viewProjection * vec4(a.xyz, 1.0);
  vec4 q = viewProjection * vec4(b.xyz, 1.0);
  // What lies behind the eye is cut off, since its projection is nonsense.
  const float near = 1e-4;
  if (p.w < near && q.w < near) return;
  if (p.w < near) p = mix(p, q, (near - p.w) / (q.w - p.w));
  if (q.w < near) q = mix(q, p, (near - q.w) / (p.w - q.w));
  bool atB = (gl_VertexID & 2) != 0;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec4 here = atB ? q : p;
  float pixels = byResidual ? mix(width.x, width.y, value * value * value) : width.x;
  vec2 direction = (q.xy / q.w - p.xy / p.w) * viewport;
  float length_ = length(direction);
  vec2 normal = length_ > 1e-6 ? vec2(-direction.y, direction.x) / length_ : vec2(0.0, 1.0);
  here.xy += side * pixels * normal / viewport * here.w;
  if (byResidual) here.z -= 1e-5 * value * here.w;  // worst on top of equals
  gl_Position = here;
  tint = byResidual ? ramp(value) : colour;
  along = atB ? arc.y : arc.x;
  faded = fading(here.w) * (byResidual ? 1.0 - value : 1.0);
}
`;

export const kLineFragment = /* glsl */ `
precision highp float;
uniform vec3 paper;
uniform float alpha;
uniform vec4 dash;          // dash, gap, dash, gap [px]; 0: solid
uniform float pixelsPerMetre;
in vec3 tint;
in float along;
in float faded;
out vec4 result;

void main() {
  float period = dash.x + dash.y + dash.z + dash.w;
  if (period > 0.0) {
    float t = mod(along * pixelsPerMetre, period);
    if ((t > dash.x && t < dash.x + dash.y) || t > period - dash.w) discard;
  }
  result = vec4(mix(tint, paper, faded), alpha);
}
`;

export const kPointVertex = /* glsl */ `${kPositions}
in int variable;
uniform float size;
uniform vec3 colour;
out vec3 tint;
out float faded;

void main() {
  vec4 p = positionOf(variable);
  gl_Position = kNowhere;
  gl_PointSize = size;
  if (p.w < 0.5) return;
  gl_Position = viewProjection * vec4(p.xyz, 1.0);
  tint = colour;
  faded = fading(gl_Position.w);
}
`;

export const kPointFragment = /* glsl */ `
precision highp float;
uniform vec3 paper;
uniform bool diamond;
uniform bool rimmed;
uniform float size;
in vec3 tint;
in float faded;
out vec4 result;

void main() {
  vec2 c = abs(2.0 * gl_PointCoord - 1.0);
  if ((diamond ? c.x + c.y : dot(c, c)) > 1.0) discard;
  // A rim of paper keeps neighbours apart.
  float rim = diamond ? c.x + c.y : length(c);
  vec3 inside = mix(tint, paper, faded);
  result = vec4(rimmed && rim > 1.0 - 2.2 / size ? paper : inside, 1.0);
}
`;

/** Axes of poses: in space x, y and z, in a plan x alone. */
export const kAxesVertex = /* glsl */ `${kPositions}
in ivec2 tip;       // variable, and which vertex: 2 × axis + (0: at the pose, 1: at the tip)
uniform sampler2D orientation;
uniform float reach;        // [m]
uniform vec3 axisColours[3];
out vec3 tint;
out float along;
out float faded;

void main() {
  vec4 p = positionOf(tip.x);
  vec4 q = texelFetch(orientation, ivec2(tip.x & ${kTextureWidth - 1}, tip.x >> ${Math.log2(kTextureWidth)}), 0);
  gl_Position = kNowhere;
  if (p.w < 0.5 || dot(q, q) < 0.5) return;
  int axis = tip.y >> 1;
  vec3 e = vec3(axis == 0, axis == 1, axis == 2);
  vec3 turned = e + 2.0 * cross(q.xyz, cross(q.xyz, e) + q.w * e);
  gl_Position = viewProjection * vec4(p.xyz + float(tip.y & 1) * reach * turned, 1.0);
  tint = axisColours[axis];
  along = 0.0;
  faded = fading(gl_Position.w);
}
`;

/** Lines given by their points: grid and ellipses. */
export const kPlainVertex = /* glsl */ `
precision highp float;
in vec3 position;
uniform mat4 viewProjection;
uniform vec3 colour;
out vec3 tint;
out float along;
out float faded;

void main() {
  gl_Position = viewProjection * vec4(position, 1.0);
  tint = colour;
  along = 0.0;
  faded = 0.0;
}
`;
