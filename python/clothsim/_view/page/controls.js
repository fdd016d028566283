// Buttons, the slider and keys.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

const withControls = (Base) => class extends Base {
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
};
