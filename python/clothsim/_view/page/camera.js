// Matrices (column by column) and a camera that turns about a point.

function multiply(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + r] * b[4 * c + k];
      out[4 * c + r] = sum;
    }
  return out;
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const scaled = (a, k) => [k * a[0], k * a[1], k * a[2]];
const unit = (a) => scaled(a, 1 / Math.hypot(...a));

function lookAt(eye, target, up) {
  const z = unit(add(eye, target, -1));
  const x = unit(cross(up, z));
  const y = cross(z, x);
  return new Float32Array([
    x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1,
  ]);
}

function perspective(tangent, aspect, near, far) {
  const out = new Float32Array(16);
  out[0] = 1 / (tangent * aspect);
  out[5] = 1 / tangent;
  out[10] = (far + near) / (near - far);
  out[11] = -1;
  out[14] = (2 * far * near) / (near - far);
  return out;
}

function orthographic(half, depth) {
  const out = new Float32Array(16);
  out[0] = out[5] = 1 / half;
  out[10] = -1 / depth;
  out[15] = 1;
  return out;
}

class Camera {
  // points: the outermost of what is to be seen; reach: their span [m]; up: 1 (y) or 2 (z).
  // view: azimuth and elevation [degrees], and how much nearer than what shows all.
  constructor(points, reach, up, view) {
    this.view = view;
    this.points = points;
    this.reach = reach;
    this.up = up === 2 ? [0, 0, 1] : [0, 1, 0];
    this.front = up === 2 ? [0, -1, 0] : [0, 0, 1];
    this.right = [1, 0, 0];
    this.tangent = Math.tan((28 / 2) * (Math.PI / 180));
    this.face();
    this.frame(1, [0, 0, 0, 0]);
  }

  // Turn to where it looked first.
  face() {
    this.azimuth = (this.view.azimuth * Math.PI) / 180;
    this.elevation = (this.view.elevation * Math.PI) / 180;
  }

  direction() {
    const c = Math.cos(this.elevation);
    const flat = add(scaled(this.right, Math.sin(this.azimuth) * c), this.front, Math.cos(this.azimuth) * c);
    return add(flat, this.up, Math.sin(this.elevation));
  }

  // Stand as near as the points allow; margins: shares of the picture that panels cover, left, right, bottom, top.
  frame(aspect, [left, right, bottom, top]) {
    const toward = this.direction();
    const across = unit(cross(this.up, toward));
    const above = cross(toward, across);
    const extent = (axis) => {
      const along = this.points.map((p) => dot(p, axis));
      return [Math.min(...along), Math.max(...along)];
    };
    // The middle of what is seen, from this side.
    const middle = [across, above, toward].map((axis) => [axis, extent(axis)])
      .reduce((sum, [axis, [low, high]]) => add(sum, axis, 0.5 * (low + high)), [0, 0, 0]);
    const tanY = this.tangent * (1 - top - bottom) * 0.94;
    const tanX = this.tangent * aspect * (1 - left - right) * 0.94;
    this.distance = 0;
    for (const point of this.points) {
      const d = add(point, middle, -1);
      const reach = Math.max(Math.abs(dot(d, above)) / tanY, Math.abs(dot(d, across)) / tanX) + dot(d, toward);
      this.distance = Math.max(this.distance, reach);
    }
    this.distance /= this.view.zoom;
    // It goes to the middle of what panels leave free.
    const shiftX = this.distance * this.tangent * aspect * (right - left);
    const shiftY = this.distance * this.tangent * (top - bottom);
    this.target = add(add(middle, across, shiftX), above, shiftY);
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.max(-1.5, Math.min(1.5, this.elevation + dy));
  }

  // dx, dy in heights of the picture.
  pan(dx, dy) {
    const toward = this.direction();
    const across = unit(cross(this.up, toward));
    const size = 2 * this.distance * this.tangent;
    this.target = add(add(this.target, across, -dx * size), cross(toward, across), dy * size);
  }

  zoom(factor) {
    this.distance = Math.max(0.01 * this.reach, Math.min(40 * this.reach, this.distance * factor));
  }

  eye() {
    return add(this.target, this.direction(), this.distance);
  }

  matrix(aspect) {
    const near = Math.max(0.002 * this.reach, this.distance - 4 * this.reach);
    const projection = perspective(this.tangent, aspect, near, this.distance + 12 * this.reach);
    return multiply(projection, lookAt(this.eye(), this.target, this.up));
  }
}
