// The page: its parts together, and the address' fragment (#frame=30&color=strain&theme=dark&panel=off).

class Viewer extends withControls(withPointer(withPanel(withPlayback(class {})))) {
  constructor(header, bodies) {
    super();
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
