// Draws bodies with WebGL 2: a shadow map from the key light, then the floor and the surfaces.

const SHADOW = 2048; // texels along a side of the shadow map

const hex = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);

class Renderer {
  constructor(canvas, bodies, header) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("This browser shows no WebGL 2 graphics, which this page needs.");
    this.gl = gl;
    this.canvas = canvas;
    this.bodies = bodies;
    this.up = header.up === 2 ? [0, 0, 1] : [0, 1, 0];
    this.header = header;
    this.surface = this.program(SURFACE_VERTEX, SURFACE_FRAGMENT);
    this.floor = this.program(FLOOR_VERTEX, FLOOR_FRAGMENT);
    this.depth = this.program(DEPTH_VERTEX, DEPTH_FRAGMENT);
    this.models = bodies.map((body) => this.model(body));
    this.makeFloor();
    this.makeShadowMap();
    this.palette = gl.createTexture();
    this.wires = false;
  }

  program(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const at = {};
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
      const name = gl.getActiveUniform(program, i).name;
      at[name.replace("[0]", "")] = gl.getUniformLocation(program, name);
    }
    return { program, at };
  }

  model(body) {
    const gl = this.gl;
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    const buffers = [body.x, body.normals, new Float32Array(body.n)].map((array, slot) => {
      const buffer = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, array.byteLength, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, slot === 2 ? 1 : 3, gl.FLOAT, false, 0, 0);
      return buffer;
    });
    const faces = this.elements(body.triangles);
    gl.bindVertexArray(null);
    return { body, vao, buffers, values: new Float32Array(body.n), faces, lines: null, lineCount: 0 };
  }

  elements(array) {
    const gl = this.gl;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, array, gl.STATIC_DRAW);
    return buffer;
  }

  // The edges of a cloth, made when first asked for.
  edges(model) {
    if (model.lines) return;
    const { triangles, n } = model.body;
    const seen = new Set();
    const list = [];
    for (let k = 0; k < triangles.length; k += 3)
      for (let c = 0; c < 3; c++) {
        const a = Math.min(triangles[k + c], triangles[k + ((c + 1) % 3)]);
        const b = Math.max(triangles[k + c], triangles[k + ((c + 1) % 3)]);
        const key = a * n + b;
        if (!seen.has(key)) {
          seen.add(key);
          list.push(a, b);
        }
      }
    this.gl.bindVertexArray(null);
    model.lines = this.elements(new Uint32Array(list));
    model.lineCount = list.length;
  }

  makeFloor() {
    const gl = this.gl;
    const { middle, reach, floor } = this.header;
    const up = this.header.up;
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]];
    const points = corners.flatMap(([a, b]) => {
      const p = middle.slice();
      p[up] = floor;
      p[0] += 12 * reach * a;
      p[up === 1 ? 2 : 1] += 12 * reach * b;
      return p;
    });
    this.floorVao = gl.createVertexArray();
    gl.bindVertexArray(this.floorVao);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
  }

  makeShadowMap() {
    const gl = this.gl;
    this.shadow = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.shadow);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.DEPTH_COMPONENT24, SHADOW, SHADOW);
    for (const [name, value] of [
      [gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE], [gl.TEXTURE_COMPARE_FUNC, gl.LEQUAL],
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    this.shadowTarget = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.shadow, 0);
    gl.drawBuffers([gl.NONE]);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    const { middle, reach, up } = this.header;
    const front = up === 2 ? [0, -1, 0] : [0, 0, 1];
    this.key = unit(add(add(scaled([1, 0, 0], -0.55), this.up, 1.35), front, 0.6));
    const view = lookAt(add(middle, this.key, reach), middle, front);
    this.sun = multiply(orthographic(0.62 * reach, 1.6 * reach), view);
  }

  setPalette(map) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, this.palette);
    const n = 256;
    const colours = map.colours.map(hex);
    const data = new Uint8Array(4 * n);
    for (let i = 0; i < n; i++) {
      const t = (i / (n - 1)) * (colours.length - 1);
      const k = Math.min(Math.floor(t), colours.length - 2);
      for (let c = 0; c < 3; c++) data[4 * i + c] = 255 * (colours[k][c] * (1 - t + k) + colours[k + 1][c] * (t - k));
      data[4 * i + 3] = 255;
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, n, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // Bring bodies to a moment, with the values that the colour map shows.
  pose(f, s, map, first) {
    const gl = this.gl;
    for (const model of this.models) {
      const { body, buffers, values } = model;
      if (body.moves || first) {
        body.pose(f, s);
        this.upload(buffers[0], body.x);
        this.upload(buffers[1], body.normals);
      }
      if (!body.isCloth || !map) continue;
      if (map.name === "height") {
        for (let i = 0; i < body.n; i++) values[i] = body.x[3 * i + this.header.up];
      } else {
        const bytes = body.values[map.name];
        const last = bytes.length / body.n - 1;
        const mix = map.classes ? Math.round(s) : s;
        const a = Math.min(f, last) * body.n, b = Math.min(f + 1, last) * body.n;
        for (let i = 0; i < body.n; i++) values[i] = bytes[a + i] * (1 - mix) + bytes[b + i] * mix;
      }
      this.upload(buffers[2], values);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
  }

  upload(buffer, array) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, array);
  }

  draw(camera, map, theme) {
    const gl = this.gl;
    gl.enable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.shadowTarget);
    gl.viewport(0, 0, SHADOW, SHADOW);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1.5, 2);
    gl.useProgram(this.depth.program);
    gl.uniformMatrix4fv(this.depth.at.sun, false, this.sun);
    for (const { body, vao } of this.models) {
      if (!body.visible) continue;
      gl.bindVertexArray(vao);
      gl.drawElements(gl.TRIANGLES, body.triangles.length, gl.UNSIGNED_INT, 0);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);

    const { width, height } = this.canvas;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.clearColor(...theme.skyline, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const matrix = camera.matrix(width / height);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.palette);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.shadow);
    this.drawFloor(camera, matrix, theme);
    this.drawSurfaces(camera, matrix, map, theme);
    gl.bindVertexArray(null);
    gl.bindTexture(gl.TEXTURE_2D, null);
  }

  shared(program, camera, matrix) {
    const gl = this.gl;
    gl.useProgram(program.program);
    gl.uniformMatrix4fv(program.at.camera, false, matrix);
    gl.uniformMatrix4fv(program.at.sun, false, this.sun);
    gl.uniform1i(program.at.shadowMap, 0);
    gl.uniform1f(program.at.texel, 1 / SHADOW);
    gl.uniform3fv(program.at.eye, camera.eye());
    return program.at;
  }

  drawFloor(camera, matrix, theme) {
    const gl = this.gl;
    const { middle, reach, floor, up } = this.header;
    if (!this.header.drawFloor || camera.eye()[up] < floor) return;
    const at = this.shared(this.floor, camera, matrix);
    const under = middle.slice();
    under[up] = floor;
    gl.uniform3fv(at.middle, under);
    gl.uniform3fv(at.floorColour, theme.floor);
    gl.uniform3fv(at.skyline, theme.skyline);
    gl.uniform1f(at.reach, reach);
    gl.uniform1f(at.spacing, this.header.spacing);
    gl.uniform1f(at.gridShade, theme.gridShade);
    gl.uniform1i(at.upAxis, up);
    gl.bindVertexArray(this.floorVao);
    gl.drawArrays(gl.TRIANGLES, 0, 6);
  }

  drawSurfaces(camera, matrix, map, theme) {
    const gl = this.gl;
    const at = this.shared(this.surface, camera, matrix);
    gl.uniform1i(at.colours, 1);
    gl.uniform3fv(at.key, this.key);
    gl.uniform3fv(at.up, this.up);
    gl.uniform3fv(at.skyColour, theme.sky);
    gl.uniform3fv(at.groundColour, theme.ground);
    gl.uniform1i(at.classes, map && map.classes ? 1 : 0);
    if (map && map.classes) gl.uniform3fv(at.classColours, map.colours.flatMap(hex));
    const inBytes = map && map.name !== "height";
    gl.uniform1f(at.low, inBytes ? 0 : map ? map.low : 0);
    gl.uniform1f(at.high, inBytes ? 255 : map ? map.high : 1);
    for (const model of this.models) {
      const { body, vao } = model;
      if (!body.visible) continue;
      gl.uniform1i(at.mapped, body.isCloth && map ? 1 : 0);
      gl.uniform1i(at.wires, 0);
      gl.uniform3fv(at.front, hex(body.colours[0]));
      gl.uniform3fv(at.back, hex(body.colours[1]));
      gl.uniform1f(at.sheen, body.isCloth ? 0.35 : 0.12);
      gl.bindVertexArray(vao);
      gl.enable(gl.POLYGON_OFFSET_FILL);
      gl.polygonOffset(this.wires ? 1 : 0, this.wires ? 1 : 0);
      gl.drawElements(gl.TRIANGLES, body.triangles.length, gl.UNSIGNED_INT, 0);
      gl.disable(gl.POLYGON_OFFSET_FILL);
      if (this.wires && body.isCloth) this.drawEdges(model, at, theme);
    }
  }

  drawEdges(model, at, theme) {
    const gl = this.gl;
    this.edges(model);
    gl.bindVertexArray(model.vao);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, model.lines);
    gl.uniform1i(at.wires, 1);
    gl.uniform3fv(at.front, theme.wire);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawElements(gl.LINES, model.lineCount, gl.UNSIGNED_INT, 0);
    gl.disable(gl.BLEND);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, model.faces);
  }
}
