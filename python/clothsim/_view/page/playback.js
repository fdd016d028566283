// Time: which frame is shown, playing, and the picture that follows.

const withPlayback = (Base) => class extends Base {
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
};
