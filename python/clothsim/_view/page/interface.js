// Playback, controls, keys and the address' fragment (#frame=30&color=strain&theme=dark&panel=off).

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const byId = (id) => document.getElementById(id);

const THEMES = {
  light: {
    skyline: "#f3f1ec", floor: "#fbf9f4", gridShade: 0.93, sky: [1.0, 1.02, 1.06], ground: [0.78, 0.74, 0.7],
    wire: "#1d1c1b", ink: "#2b2927", faint: "#6d6862", line: "#dcd7ce", accent: "#9c2f35",
  },
  dark: {
    skyline: "#17181c", floor: "#24262c", gridShade: 1.22, sky: [0.86, 0.92, 1.04], ground: [0.4, 0.39, 0.4],
    wire: "#0c0c0d", ink: "#efece6", faint: "#a19c95", line: "#3a3c43", accent: "#ef7f6f",
  },
};
for (const theme of Object.values(THEMES))
  for (const key of ["skyline", "floor", "wire"]) theme[key] = hex(theme[key]);

class Viewer {
  constructor(header, bodies) {
    this.header = header;
    this.bodies = bodies;
    this.times = header.times;
    this.count = header.frames;
    this.time = this.times[0];
    this.playing = false;
    this.speed = 1;
    this.map = null;
    this.canvas = byId("view");
    this.renderer = new Renderer(this.canvas, bodies, header);
    this.camera = new Camera(header.outline, header.reach, header.up, header.start);
    this.moved = false; // the camera, by hand
    this.first = true;
    this.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    this.makePanel();
    this.bindTransport();
    this.bindCanvas();
    document.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("hashchange", () => this.readFragment());
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.setTheme(this.theme);
    const asked = this.readFragment();
    this.resize();
    if (!asked && this.count > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) this.play(true);
  }

  // Time ------------------------------------------------------------------------------------------------------

  // Frame before a time, and the share of the way to the next one.
  place(time) {
    const { times } = this;
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-9) low = middle;
      else high = middle - 1;
    }
    if (low + 1 >= times.length) return [low, 0];
    const s = (time - times[low]) / (times[low + 1] - times[low]);
    return [low, s < 1e-6 ? 0 : Math.min(s, 1)];
  }

  get frame() {
    const [f, s] = this.place(this.time);
    return s > 0.5 ? f + 1 : f;
  }

  setFrame(frame) {
    this.time = this.times[Math.max(0, Math.min(this.count - 1, frame))];
    this.dirty = true;
    this.request();
  }

  play(on) {
    if (this.count < 2) return;
    const end = this.times[this.count - 1];
    if (on && this.time >= end) this.time = this.times[0];
    if (this.playing && !on) this.time = this.times[this.frame]; // stand on a frame
    this.playing = on;
    this.last = null;
    this.dirty = true;
    const button = byId("play");
    button.setAttribute("aria-label", on ? "Pause" : "Play");
    button.dataset.playing = on;
    this.request();
  }

  request() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame((now) => {
      this.pending = false;
      this.tick(now);
    });
  }

  tick(now) {
    if (this.playing) {
      const end = this.times[this.count - 1], start = this.times[0];
      if (this.last !== null) this.time += (Math.min(now - this.last, 200) / 1000) * this.speed;
      this.last = now;
      if (this.time > end) this.time = byId("loop").getAttribute("aria-pressed") === "true" ? start : end;
      if (this.time >= end && byId("loop").getAttribute("aria-pressed") !== "true") this.play(false);
      this.dirty = true;
    }
    const [f, s] = this.place(this.time);
    if (this.dirty) {
      this.renderer.pose(f, s, this.map, this.first);
      this.first = false;
      this.showTime();
    }
    this.dirty = false;
    this.renderer.draw(this.camera, this.map, THEMES[this.theme]);
    if (!byId("panel").hidden) this.plots.forEach((plot) => plot.draw(this.time, this.frame, THEMES[this.theme]));
    document.documentElement.dataset.state = "ready";
    if (this.playing) this.request();
  }

  showTime() {
    const k = this.frame;
    const number = this.header.numbers[k];
    const last = this.header.total - 1;
    byId("frame").textContent = `frame ${number} / ${last}`;
    byId("time").textContent = `${this.time.toFixed(this.header.digits)} s`;
    const scrub = byId("scrub");
    scrub.value = k;
    scrub.style.setProperty("--share", `${(100 * k) / Math.max(1, this.count - 1)}%`);
    scrub.setAttribute("aria-valuetext", `frame ${number} of ${last}, ${this.time.toFixed(this.header.digits)} seconds`);
  }

  // Panel -----------------------------------------------------------------------------------------------------

  makePanel() {
    const { header } = this;
    byId("title").textContent = header.title;
    byId("facts").textContent = header.facts;
    byId("notices").replaceChildren(...header.notices.map((text) => element("li", text)));
    this.canvas.setAttribute("aria-label", header.description);
    const choice = byId("colour");
    choice.append(option("none", "Cloth"));
    for (const map of header.maps) choice.append(option(map.name, map.label[0].toUpperCase() + map.label.slice(1)));
    choice.addEventListener("change", () => this.setMap(choice.value));
    const list = byId("bodies");
    for (const body of this.bodies) {
      const box = element("input");
      box.type = "checkbox";
      box.checked = body.visible;
      box.addEventListener("change", () => {
        body.visible = box.checked;
        this.request();
      });
      const label = element("label");
      const swatch = element("i");
      swatch.style.background = `linear-gradient(135deg, ${body.colours[0]} 55%, ${body.colours[1]} 55%)`;
      label.append(box, swatch, body.name, element("small", `${body.triangles.length / 3} triangles`));
      const row = element("li");
      row.append(label);
      list.append(row);
    }
    this.plots = header.plots.map(
      (spec) => new Plot(byId("plots"), spec, this.times, (share) => {
        this.play(false);
        const end = this.times[this.count - 1];
        this.time = this.times[0] + share * (end - this.times[0]);
        this.setFrame(this.frame);
      }),
    );
    byId("plots-part").hidden = this.plots.length === 0;
    if (matchMedia("(max-width: 760px)").matches) this.setPanel(false);
  }

  setMap(name) {
    const found = this.header.maps.find((map) => map.name === name);
    this.map = found || null;
    byId("colour").value = found ? name : "none";
    const legend = byId("legend");
    legend.replaceChildren();
    if (found && found.classes) {
      const list = element("ul");
      found.classes.forEach((text, k) => {
        const swatch = element("i");
        swatch.style.background = found.colours[k];
        const row = element("li");
        row.append(swatch, text);
        list.append(row);
      });
      legend.append(list);
    } else if (found) {
      this.renderer.setPalette(found);
      const bar = element("div");
      bar.className = "bar";
      bar.style.background = `linear-gradient(90deg, ${found.colours.join(", ")})`;
      const ticks = element("div");
      ticks.className = "ticks";
      for (const share of [0, 0.25, 0.5, 0.75, 1]) {
        const value = (found.low + share * (found.high - found.low)) * found.scale;
        ticks.append(element("span", short(value) + (share === 1 ? ` ${found.unit}` : "")));
      }
      legend.append(bar, ticks);
    }
    if (found && found.note) legend.append(element("p", found.note));
    this.dirty = true;
    this.request();
  }

  setTheme(name) {
    this.theme = name;
    document.documentElement.dataset.theme = name;
    this.preparePlots();
    this.request();
  }

  setPanel(on) {
    byId("panel").hidden = !on;
    byId("panel-button").setAttribute("aria-expanded", on);
    this.preparePlots();
    if (this.renderer && !this.moved) this.reset();
    this.request();
  }

  preparePlots() {
    if (this.plots && !byId("panel").hidden) this.plots.forEach((plot) => plot.prepare(THEMES[this.theme]));
  }

  // Camera ----------------------------------------------------------------------------------------------------

  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
      if (!this.moved) this.reset();
    }
    this.preparePlots();
    this.request();
  }

  // The whole subject, in the part of the picture that no panel covers.
  reset() {
    this.moved = false;
    const w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    const panel = byId("panel").getBoundingClientRect();
    const right = byId("panel").hidden || panel.width > 0.6 * w ? 0 : (w - panel.left) / w;
    const bottom = (h - byId("transport").getBoundingClientRect().top) / h;
    const top = byId("card").getBoundingClientRect().bottom / h;
    this.camera.frame(w / h, [0, right, bottom, Math.min(top, 0.2) * 0.6]);
    this.request();
  }

  home() {
    this.camera.face();
    this.reset();
  }

  bindCanvas() {
    const pointers = new Map();
    const { canvas, camera } = this;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, event);
    });
    const release = (event) => pointers.delete(event.pointerId);
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const h = canvas.clientHeight;
      const dx = (event.clientX - before.clientX) / h, dy = (event.clientY - before.clientY) / h;
      if (pointers.size === 2) {
        const other = [...pointers.values()].find((p) => p.pointerId !== event.pointerId);
        const gap = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
        camera.zoom(gap(before) / gap(event));
        camera.pan(dx / 2, dy / 2);
      } else if (event.buttons & 6 || event.shiftKey) camera.pan(dx, dy);
      else camera.turn(dx * 4, dy * 4);
      pointers.set(event.pointerId, event);
      this.moved = true;
      this.request();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(Math.max(-0.5, Math.min(0.5, event.deltaY * (event.deltaMode ? 0.05 : 0.0015)))));
      this.moved = true;
      this.request();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.home());
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextlost", () => fail("The graphics were lost. Reload the page."));
  }

  // Controls --------------------------------------------------------------------------------------------------

  bindTransport() {
    const scrub = byId("scrub");
    scrub.max = this.count - 1;
    scrub.disabled = this.count < 2;
    scrub.addEventListener("input", () => {
      this.play(false);
      this.setFrame(Number(scrub.value));
    });
    byId("play").addEventListener("click", () => this.play(!this.playing));
    byId("back").addEventListener("click", () => this.step(-1));
    byId("forth").addEventListener("click", () => this.step(1));
    const speed = byId("speed");
    for (const factor of SPEEDS) speed.append(option(factor, `${factor} ×`));
    speed.value = 1;
    speed.addEventListener("change", () => (this.speed = Number(speed.value)));
    byId("loop").addEventListener("click", (event) => toggle(event.currentTarget));
    byId("home").addEventListener("click", () => this.home());
    byId("edges").addEventListener("click", (event) => {
      this.renderer.wires = toggle(event.currentTarget);
      this.request();
    });
    byId("theme").addEventListener("click", () => this.setTheme(this.theme === "dark" ? "light" : "dark"));
    byId("panel-button").addEventListener("click", () => this.setPanel(byId("panel").hidden));
    byId("help-button").addEventListener("click", () => byId("help").showModal());
  }

  step(by) {
    this.play(false);
    this.setFrame(this.frame + by);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("help").open) return;
    const tag = event.target.tagName;
    if (tag === "SELECT" || (event.target.id === "scrub" && event.key.startsWith("Arrow"))) return;
    if (event.key === " " && (tag === "BUTTON" || event.target.type === "checkbox")) return;
    const maps = ["none", ...this.header.maps.map((map) => map.name)];
    const turn = (x, y) => {
      this.camera.turn(x, y);
      this.moved = true;
      this.request();
    };
    const zoom = (factor) => {
      this.camera.zoom(factor);
      this.moved = true;
      this.request();
    };
    const keys = {
      " ": () => this.play(!this.playing), Home: () => this.step(-this.count), End: () => this.step(this.count),
      ArrowLeft: () => (event.shiftKey ? turn(0.1, 0) : this.step(-1)),
      ArrowRight: () => (event.shiftKey ? turn(-0.1, 0) : this.step(1)),
      ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1), "+": () => zoom(0.9), "=": () => zoom(0.9),
      "-": () => zoom(1.1), c: () => this.setMap(maps[(maps.indexOf(byId("colour").value) + 1) % maps.length]),
      e: () => byId("edges").click(), h: () => this.home(), l: () => byId("loop").click(),
      t: () => byId("theme").click(), p: () => this.setPanel(byId("panel").hidden), "?": () => byId("help").showModal(),
    };
    const action = keys[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  }

  // What the address asks for; frames by their numbers in the run, the nearest that the page has.
  readFragment() {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (asked.has("theme")) this.setTheme(asked.get("theme") === "dark" ? "dark" : "light");
    if (asked.has("panel")) this.setPanel(asked.get("panel") !== "off");
    this.setMap(asked.get("color") || (this.map ? this.map.name : this.header.start.colour));
    const wanted = asked.has("frame") ? Number(asked.get("frame")) || 0 : this.first ? this.header.start.frame : null;
    if (wanted === null) return false;
    const gaps = this.header.numbers.map((number) => Math.abs(number - wanted));
    this.play(false);
    this.setFrame(gaps.indexOf(Math.min(...gaps)));
    return true;
  }

  // Where a point [m] is in the window [px]: for tests and for those who annotate screenshots.
  project(point) {
    const w = this.canvas.clientWidth, h = this.canvas.clientHeight;
    const m = this.camera.matrix(w / h);
    const p = [0, 1, 2, 3].map((r) => m[r] * point[0] + m[4 + r] * point[1] + m[8 + r] * point[2] + m[12 + r]);
    return [(0.5 + (0.5 * p[0]) / p[3]) * w, (0.5 - (0.5 * p[1]) / p[3]) * h];
  }
}

function element(tag, text) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  return made;
}

function option(value, text) {
  const made = element("option", text);
  made.value = value;
  return made;
}

function toggle(button) {
  const on = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", on);
  return on;
}

function fail(text) {
  byId("failure").textContent = text;
  byId("failure").hidden = false;
  document.documentElement.dataset.state = "failed";
}

async function main() {
  try {
    if (!("DecompressionStream" in window)) throw new Error("This browser is too old for this page: it needs one of 2023 or later.");
    const header = JSON.parse(byId("header").textContent);
    const raw = await inflate(byId("data").textContent);
    byId("data").remove();
    if (raw.length !== header.raw) throw new Error("This page is damaged: its data are cut off.");
    const bodies = header.bodies.map((entry) => Object.assign(new Body(entry, raw, header.frames), { colours: entry.colours }));
    window.clothsim = new Viewer(header, bodies);
  } catch (error) {
    fail(error.message);
    throw error;
  }
}

main();
