// The panel: colour maps with their legends, bodies, plots; and the theme.

const withPanel = (Base) => class extends Base {
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
};
