// The canvas: its size, and the camera in the hand.

const withPointer = (Base) => class extends Base {
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
};
