// The run's data: base64 → DEFLATE → arrays. clothsim/_view/pack.py writes what is read here.

async function inflate(base64) {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Inverse of residuals(): planes of low and high bytes per frame and axis → whole numbers of 16 bits.
function restore(planes, frames, n) {
  const q = new Uint16Array(frames * n * 3);
  let at = 0;
  for (let f = 0; f < frames; f++) {
    const row = f * n * 3;
    for (let axis = 0; axis < 3; axis++) {
      let sum = 0;
      for (let i = 0; i < n; i++) {
        const folded = planes[at + i] | (planes[at + n + i] << 8);
        sum += (folded >> 1) ^ -(folded & 1);
        const here = row + 3 * i + axis;
        let value = sum;
        if (f === 1) value += q[here - 3 * n];
        else if (f > 1) value += 2 * q[here - 3 * n] - q[here - 6 * n];
        q[here] = value;
      }
      at += 2 * n;
    }
  }
  return q;
}

class Body {
  constructor(entry, raw, frames) {
    const bytes = (place) => raw.subarray(place.at, place.at + place.bytes);
    this.name = entry.name;
    this.isCloth = entry.kind === "cloth";
    this.n = entry.vertices;
    this.frames = entry.count;
    this.low = entry.low;
    this.step = entry.step;
    this.triangles = new Uint32Array(bytes(entry.triangles).slice().buffer);
    this.q = restore(bytes(entry.positions), entry.count, this.n);
    this.motion = entry.motion ? new Float32Array(bytes(entry.motion).slice().buffer) : null;
    this.values = {};
    for (const [name, place] of Object.entries(entry.values || {})) {
      const v = bytes(place).slice();
      for (let i = this.n; i < frames * this.n; i++) v[i] += v[i - this.n];
      this.values[name] = v;
    }
    this.x = new Float32Array(3 * this.n); // positions [m] and normals at the moment that is shown
    this.normals = new Float32Array(3 * this.n);
    this.moves = this.frames > 1 || this.motion !== null;
    this.visible = true;
  }

  // Positions at a moment between two frames: f + s, 0 ≤ s < 1.
  pose(f, s) {
    const { x, q, n, step, low } = this;
    const last = this.frames - 1;
    const a = Math.min(f, last) * 3 * n;
    const b = Math.min(f + 1, last) * 3 * n;
    const t = s * step;
    const u = step - t;
    for (let i = 0; i < 3 * n; i += 3) {
      x[i] = low[0] + q[a + i] * u + q[b + i] * t;
      x[i + 1] = low[1] + q[a + i + 1] * u + q[b + i + 1] * t;
      x[i + 2] = low[2] + q[a + i + 2] * u + q[b + i + 2] * t;
    }
    if (this.motion) this.carry(f, s);
    this.shade();
  }

  carry(f, s) {
    const { x, n, motion } = this;
    const a = Math.min(f, motion.length / 12 - 1) * 12;
    const b = Math.min(f + 1, motion.length / 12 - 1) * 12;
    const m = new Float32Array(12);
    for (let k = 0; k < 12; k++) m[k] = motion[a + k] * (1 - s) + motion[b + k] * s;
    for (let i = 0; i < 3 * n; i += 3) {
      const p = x[i], r = x[i + 1], z = x[i + 2];
      x[i] = m[0] * p + m[3] * r + m[6] * z + m[9];
      x[i + 1] = m[1] * p + m[4] * r + m[7] * z + m[10];
      x[i + 2] = m[2] * p + m[5] * r + m[8] * z + m[11];
    }
  }

  // Normals of vertices: sums of their triangles' normals times area.
  shade() {
    const { x, normals, triangles } = this;
    normals.fill(0);
    for (let k = 0; k < triangles.length; k += 3) {
      const a = 3 * triangles[k], b = 3 * triangles[k + 1], c = 3 * triangles[k + 2];
      const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2];
      const vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
      const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      for (const i of [a, b, c]) {
        normals[i] += nx;
        normals[i + 1] += ny;
        normals[i + 2] += nz;
      }
    }
  }
}
