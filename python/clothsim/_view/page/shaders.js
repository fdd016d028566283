// GLSL of the viewer: surfaces with two sides and a shadow map, the floor, and the pass that draws the map.

const SURFACE_VERTEX = `#version 300 es
layout(location = 0) in vec3 x;
layout(location = 1) in vec3 normal;
layout(location = 2) in float value;
uniform mat4 camera, sun;
uniform int classes;
out vec3 at, facing, sunlit;
out vec3 map;
void main() {
  at = x;
  float size = length(normal);
  facing = size > 0.0 ? normal / size : vec3(0.0);
  vec4 s = sun * vec4(x, 1.0);
  sunlit = s.xyz * 0.5 + 0.5;
  // Of a class, each vertex gives its share; of a number, the number.
  map = classes == 1 ? vec3(value, float(value == 1.0), float(value == 2.0)) : vec3(value, 0.0, 0.0);
  gl_Position = camera * vec4(x, 1.0);
}`;

const LIGHT = `
uniform highp sampler2DShadow shadowMap;
uniform float texel;
float lit(vec3 p) {
  if (any(lessThan(p, vec3(0.0))) || any(greaterThan(p, vec3(1.0)))) return 1.0;
  float sum = 0.0;
  for (int i = -2; i <= 2; i++)
    for (int j = -2; j <= 2; j++) sum += texture(shadowMap, vec3(p.xy + 1.3 * texel * vec2(i, j), p.z - 0.0012));
  return sum / 25.0;
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
in vec3 at, facing, sunlit;
in vec3 map;
uniform vec3 eye, key, up, front, back, skyColour, groundColour;
uniform vec3 classColours[3];
uniform int mapped, classes, wires;
uniform float low, high, sheen;
uniform sampler2D colours;
out vec4 colour;
${LIGHT}
vec3 linear(vec3 c) { return pow(c, vec3(2.2)); }
void main() {
  if (wires == 1) { colour = vec4(front, 0.35); return; }
  vec3 toEye = normalize(eye - at);
  vec3 flatNormal = cross(dFdx(at), dFdy(at));
  bool isFront = gl_FrontFacing;
  if (dot(flatNormal, toEye) < 0.0) flatNormal = -flatNormal;
  vec3 n = dot(facing, facing) > 0.0 ? normalize(facing) : normalize(flatNormal);
  if (!isFront) n = -n;
  vec3 base = linear(isFront ? front : back);
  if (mapped == 1 && classes == 1) {
    base = linear(classColours[0]) * max(0.0, 1.0 - map.y - map.z) + linear(classColours[1]) * map.y + linear(classColours[2]) * map.z;
  } else if (mapped == 1) {
    float t = clamp((map.x - low) / (high - low), 0.0, 1.0);
    base = linear(texture(colours, vec2(t * (1.0 - 1.0 / 256.0) + 0.5 / 256.0, 0.5)).rgb);
  }
  if (mapped == 1 && !isFront) base *= 0.82;
  float wrapped = max(0.0, (dot(n, key) + 0.12) / 1.12);
  float sun = wrapped * lit(sunlit);
  vec3 sky = mix(groundColour, skyColour, 0.5 + 0.5 * dot(n, up));
  float head = 0.30 * max(0.0, dot(n, toEye));
  vec3 light = vec3(1.0, 0.955, 0.89) * 1.75 * sun + sky * 0.62 + vec3(0.92, 0.96, 1.0) * head;
  vec3 half_ = normalize(key + toEye);
  float gloss = pow(max(0.0, dot(n, half_)), 24.0) * 0.10 * step(0.0, dot(n, key)) * sun;
  float rim = pow(1.0 - max(0.0, dot(n, toEye)), 3.5) * sheen;
  vec3 c = base * light * (mapped == 1 ? 0.57 : 0.62) + gloss + base * rim;
  c = c / (1.0 + 0.18 * max(max(c.r, c.g), c.b)); // soft shoulder: no colour burns out
  colour = vec4(pow(c, vec3(1.0 / 2.2)), 1.0);
}`;

const FLOOR_VERTEX = `#version 300 es
layout(location = 0) in vec3 x;
uniform mat4 camera, sun;
out vec3 at, sunlit;
void main() {
  at = x;
  sunlit = (sun * vec4(x, 1.0)).xyz * 0.5 + 0.5;
  gl_Position = camera * vec4(x, 1.0);
}`;

const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
in vec3 at, sunlit;
uniform vec3 middle, floorColour, skyline, eye;
uniform float reach, spacing, gridShade;
out vec4 colour;
${LIGHT}
float lines(vec2 p, float gap) {
  vec2 w = fwidth(p) / gap;
  vec2 d = abs(fract(p / gap - 0.5) - 0.5);
  vec2 l = smoothstep(w * 1.4, vec2(0.0), d) * clamp(1.0 - 3.0 * w, 0.0, 1.0);
  return max(l.x, l.y);
}
uniform int upAxis;
void main() {
  vec3 from = at - middle;
  float far = length(from) / reach;
  float fade = smoothstep(5.5, 0.4, far);
  vec2 p = upAxis == 1 ? at.xz : at.xy;
  vec3 c = mix(skyline, floorColour, fade);
  c = mix(c, c * gridShade, lines(p, spacing) * 0.75 * smoothstep(2.2, 0.5, far));
  c *= mix(1.0, 0.74 + 0.26 * lit(sunlit), smoothstep(3.0, 1.0, far));
  colour = vec4(c, 1.0);
}`;

const DEPTH_VERTEX = `#version 300 es
layout(location = 0) in vec3 x;
uniform mat4 sun;
void main() { gl_Position = sun * vec4(x, 1.0); }`;

const DEPTH_FRAGMENT = `#version 300 es
precision mediump float;
void main() {}`;
