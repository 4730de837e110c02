// Renders, heat maps on one scale, two of them compared, and boxes of trees.

const loadImage = (src) => new Promise((done, failed) => {
  const image = new Image();
  image.onload = () => done(image);
  image.onerror = failed;
  image.src = src;
});

class Pictures {
  constructor(data) {
    this.data = data;
    this.ramp = data.ramp;
    this.greys = new Map();
    this.form = document.getElementById("picture-choice").elements;
    this.compare = document.getElementById("compare-choice").elements;
    this.boxes = document.getElementById("boxes-choice").elements;
    const several = new Set(data.scenes.map((s) => s.run)).size > 1;
    options(this.form.picture, data.scenes.map((s, at) => [String(at), several ? `${s.label} (${s.run})` : s.label]));
    this.form.picture.addEventListener("change", () => choose({ pick: this.form.picture.value }));
    this.form.kind.addEventListener("change", () => this.show());
    for (const control of [this.compare.left, this.compare.right, this.compare.slider]) control.addEventListener("input", () => this.drawCompared());
    this.compare.mode.addEventListener("input", () => { this.compare.slider.value = 50; this.drawCompared(); });
    for (const control of [this.boxes.tree, this.boxes.axis, this.boxes.level]) control.addEventListener("input", () => this.drawBoxes());
    document.getElementById("compare-canvas").addEventListener("pointermove", (event) => {
      if (event.buttons !== 1 && event.pointerType === "mouse") return;
      const box = event.currentTarget.getBoundingClientRect();
      if (this.compare.mode.value !== "wipe") return;
      this.compare.slider.value = 100 * (event.clientX - box.left) / box.width;
      this.drawCompared();
    });
    this.follow();
  }

  // The scene that filters or an address chose.
  follow() {
    const wanted = state.pick || String(this.data.scenes.findIndex((s) => !state.scene || s.label === state.scene));
    if (wanted in this.data.scenes) this.form.picture.value = wanted;
    return this.show();
  }

  get scene() { return this.data.scenes[Number(this.form.picture.value)]; }

  // Counts of a map as shares of the scale, 0 to 255.
  async grey(map, width, height) {
    if (!this.greys.has(map.src)) {
      const canvas = element("canvas", { width, height });
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(await loadImage(map.src), 0, 0);
      const pixels = context.getImageData(0, 0, width, height).data;
      this.greys.set(map.src, Uint8Array.from({ length: width * height }, (_, at) => pixels[4 * at]));
    }
    return this.greys.get(map.src);
  }

  count(share, kind) { return kind.log ? Math.expm1(share * Math.log1p(kind.top)) : share * kind.top; }

  colour(share) { return this.ramp[Math.round(share * (this.ramp.length - 1))]; }

  paint(canvas, width, height, colourAt) {
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext("2d");
    const image = context.createImageData(width, height);
    for (let at = 0; at < width * height; ++at) {
      const [r, g, b] = colourAt(at);
      image.data.set([r, g, b, 255], 4 * at);
    }
    context.putImageData(image, 0, 0);
    return context;
  }

  async show() {
    const scene = this.scene, gallery = document.getElementById("gallery");
    const token = (this.token = {});
    const parts = [element("figure", {},
      element("img", { src: scene.picture.src, width: scene.picture.width, height: scene.picture.height, alt: `Picture of ${scene.label}` }),
      element("figcaption", {}, scene.label))];
    const heat = scene.heat, kind = heat && heat.kinds[this.form.kind.value];
    if (heat) {
      for (const map of kind.maps) {
        const grey = await this.grey(map, heat.width, heat.height);
        const word = this.form.kind.value === "steps" ? "visits" : "tests";
        const facts = `mean ${figure(map.mean, 3)} ${word}, most ${map.most.toLocaleString("en-US")}`;
        const caption = element("span", { class: "note" }, facts);
        const canvas = element("canvas", { role: "img", "aria-label": `Heat map of ${map.spec}: ${facts} a ray` });
        this.paint(canvas, heat.width, heat.height, (at) => this.colour(grey[at] / 255));
        canvas.addEventListener("pointermove", (event) => {
          const x = Math.floor(event.offsetX / canvas.clientWidth * heat.width), y = Math.floor(event.offsetY / canvas.clientHeight * heat.height);
          const value = grey[Math.min(heat.height - 1, y) * heat.width + Math.min(heat.width - 1, x)];
          caption.textContent = `here ${value === 255 && kind.clipped ? "at least" : "about"} ${figure(this.count(value / 255, kind), 2)} ${word}`;
        });
        canvas.addEventListener("pointerleave", () => { caption.textContent = facts; });
        parts.push(element("figure", {}, canvas, element("figcaption", {}, map.spec, " ", caption)));
      }
      const bar = element("canvas", { "aria-hidden": "true" });
      this.paint(bar, 256, 1, (at) => this.colour(at / 255));
      const silent = Object.entries(heat.silent).map(([spec, why]) => `${spec} ${why}`).join("; ");
      parts.push(element("div", { class: "scale" }, "0", bar,
        `${Math.round(kind.top).toLocaleString("en-US")}${kind.clipped ? " and more" : ""} a ray${kind.log ? ", logarithmic" : ""}${silent ? `. Not shown: ${silent}.` : ""}`));
    }
    if (token !== this.token) return; // another choice came in between
    gallery.replaceChildren(...parts);
    document.getElementById("compare").hidden = !heat || kind.maps.length < 2;
    if (heat && kind.maps.length > 1) {
      const specs = kind.maps.map((m) => [m.spec, m.spec]);
      options(this.compare.left, specs, this.compare.left.value || specs[0][0]);
      options(this.compare.right, specs, this.compare.right.value || specs[specs.length - 1][0]);
      await this.drawCompared();
    }
    document.getElementById("boxes").hidden = !scene.trees || !scene.trees.length;
    if (scene.trees && scene.trees.length) {
      const first = !this.boxes.tree.value;
      options(this.boxes.tree, scene.trees.map((t) => [t.spec, t.spec]), this.boxes.tree.value);
      if (first) { // the whole says nothing of a tree
        const levels = scene.trees[0].levels.length;
        this.boxes.level.max = String(levels - 1);
        this.boxes.level.value = String(Math.min(4, Math.floor((levels - 1) / 2)));
      }
      this.drawBoxes();
    }
  }

  async drawCompared() {
    const heat = this.scene.heat, kind = heat.kinds[this.form.kind.value];
    const [left, right] = [this.compare.left, this.compare.right].map((s) => kind.maps.find((m) => m.spec === s.value));
    const [a, b] = [await this.grey(left, heat.width, heat.height), await this.grey(right, heat.width, heat.height)];
    const canvas = document.getElementById("compare-canvas"), note = document.getElementById("compare-note");
    const slider = Number(this.compare.slider.value), word = this.form.kind.value === "steps" ? "visits" : "tests";
    if (this.compare.mode.value === "wipe") {
      document.getElementById("slider-name").textContent = "boundary";
      const edge = Math.round(heat.width * slider / 100);
      const context = this.paint(canvas, heat.width, heat.height, (at) => this.colour((at % heat.width < edge ? a : b)[at] / 255));
      context.fillStyle = "#ffffff";
      context.fillRect(edge, 0, 1, heat.height);
      note.textContent = `Left of the line ${left.spec}, right of it ${right.spec}; ${word} per ray on one scale. Drag in the picture, or use the slider.`;
      return;
    }
    document.getElementById("slider-name").textContent = "range";
    const top = Math.max(1, kind.top * Math.pow(10, -(100 - slider) / 40));
    const mean = (map) => map.reduce((sum, v) => sum + this.count(v / 255, kind), 0) / map.length;
    this.paint(canvas, heat.width, heat.height, (at) => {
      const gap = (this.count(a[at] / 255, kind) - this.count(b[at] / 255, kind)) / top, x = Math.min(1, Math.abs(gap));
      const [r, g, bl] = gap > 0 ? [230, 110, 20] : [40, 140, 230];
      return [r * x + 20 * (1 - x), g * x + 22 * (1 - x), bl * x + 26 * (1 - x)];
    });
    note.textContent = `Orange: ${left.spec} costs more, blue: ${right.spec} costs more; full colour at ${figure(top, 2)} ${word} a ray. Mean difference ${figure(mean(a) - mean(b), 3)}.`;
  }

  drawBoxes() {
    const tree = this.scene.trees.find((t) => t.spec === this.boxes.tree.value), axis = Number(this.boxes.axis.value);
    this.boxes.level.max = String(tree.levels.length - 1);
    const level = Math.min(Number(this.boxes.level.value), tree.levels.length - 1);
    const [u, v] = [0, 1, 2].filter((k) => k !== axis);
    const root = tree.levels[0][0], canvas = document.getElementById("boxes-canvas"), size = 680;
    const wide = root[3 + u] - root[u] || 1, high = root[3 + v] - root[v] || 1, scale = (size - 20) / Math.max(wide, high);
    canvas.width = Math.ceil(wide * scale) + 20;
    canvas.height = Math.ceil(high * scale) + 20;
    const context = canvas.getContext("2d"), dark = theming() === "dark", boxes = tree.levels[level];
    context.lineWidth = 1.2;
    for (const box of boxes) {
      const x = 10 + (box[u] - root[u]) * scale, y = canvas.height - 10 - (box[3 + v] - root[v]) * scale;
      const w = Math.max(1, (box[3 + u] - box[u]) * scale), h = Math.max(1, (box[3 + v] - box[v]) * scale);
      context.fillStyle = box[6] ? (dark ? "#ff8a3d44" : "#d55e0033") : (dark ? "#56b4e922" : "#0072b21c");
      context.strokeStyle = box[6] ? (dark ? "#ff8a3d" : "#c04f00") : (dark ? "#56b4e9aa" : "#0072b299");
      context.fillRect(x, y, w, h);
      context.strokeRect(x, y, w, h);
    }
    const leaves = boxes.filter((box) => box[6]).length, more = tree.depth + 1 > tree.levels.length ? `; ${tree.depth + 1 - tree.levels.length} deeper levels are not kept` : "";
    document.getElementById("boxes-note").textContent =
      `${tree.spec}, level ${level} of ${tree.depth}: ${boxes.length} boxes${leaves ? `, ${leaves} of them leaves (orange)` : ""}${more}.`;
  }
}
