// Why is one structure slower than another: the same split as `raybench explain` prints.

const WORK = { steps: "visits", prims: "primitive tests", bytes: "bytes" };

class Explain {
  constructor(prices, cases) {
    this.prices = prices;
    const queries = cases.filter((c) => c.query !== "build" && c.status === "timed" && known(c.median_ns) && c.structure !== DATA.null && c.order !== "shuffled");
    const fewest = new Map(), whole = new Map();
    for (const c of queries) {
      const key = [c.run, c.label, c.spec].join("\u0000");
      fewest.set(key, Math.min(fewest.get(key) ?? Infinity, c.threads));
    }
    this.rows = queries.filter((c) => c.threads === fewest.get([c.run, c.label, c.spec].join("\u0000")));
    for (const c of this.rows) if (c.spec === c.anchor) whole.set([c.run, c.label, c.rays_label].join("\u0000"), c.median_ns);
    // Time as over the anchor's full set, where only a part was timed.
    this.rows = this.rows.map((c) => {
      const full = whole.get([c.run, c.label, c.rays_label].join("\u0000"));
      return { ...c, ns: full && c.anchor_ns && c.timed_rays < c.rays ? c.median_ns * full / c.anchor_ns : c.median_ns };
    });
    this.form = document.getElementById("explain").elements;
    for (const name of ["run", "on", "rays", "one", "other"]) this.form[name].addEventListener("change", () => this.keep());
    this.form.run.parentElement.hidden = DATA.runs.length < 2;
    this.follow();
  }

  values(column, test) {
    return [...new Set(this.rows.filter(test).map((c) => c[column]))].map((v) => [v, v]);
  }

  // What is counted and fastest here: the natural one to compare with.
  rival(run, on, spec) {
    const here = this.rows.filter((c) => c.run === run && c.label === on && c.spec !== spec);
    const counted = here.filter((c) => known(c.steps) && known(c.prims)).sort((a, b) => a.ns - b.ns);
    const order = DATA.order.filter((s) => counted.some((c) => c.spec === s));
    return order[0] || (here[0] && here[0].spec);
  }

  // `why` in the address: run, scene, rays, one, other.
  follow() {
    const [run, on, rays, one, other] = state.why.split("~");
    this.fill(run, on || state.scene, rays || state.rays, one, other);
    this.show();
  }

  fill(run, on, rays, one, other) {
    options(this.form.run, DATA.runs.map((r) => [r, r]), run);
    const here = (c) => c.run === this.form.run.value;
    options(this.form.on, this.values("label", here), on);
    const there = (c) => here(c) && c.label === this.form.on.value;
    const slow = [...DATA.order].reverse().find((s) => this.rows.some((c) => there(c) && c.spec === s && known(c.steps)));
    const specs = DATA.order.filter((s) => this.rows.some((c) => there(c) && c.spec === s)).map((s) => [s, s]);
    options(this.form.one, specs, one || slow);
    options(this.form.other, specs, other || this.rival(this.form.run.value, this.form.on.value, this.form.one.value));
    options(this.form.rays, this.values("rays_label", (c) => there(c) && c.spec === this.form.one.value), rays);
  }

  keep() {
    const { run, on, rays, one, other } = this.form;
    this.fill(run.value, on.value, rays.value, one.value, other.value);
    choose({ why: [run.value, on.value, rays.value, one.value, other.value].join("~") });
  }

  // From a row of a table.
  ask(row) {
    choose({ why: [row.run || DATA.runs[0], row.label, row.rays_label || state.rays || "", row.spec, ""].join("~") });
    goTo("why");
  }

  gap() {
    const { run, on, rays, one, other } = this.form;
    const find = (spec) => this.rows.find((c) => c.run === run.value && c.label === on.value && c.rays_label === rays.value && c.spec === spec);
    const [a, b] = [find(one.value), find(other.value)];
    const price = this.prices.find((p) => p.run === run.value && p.label === on.value);
    if (!a || !b) return null;
    let parts = null;
    if (price && Object.keys(WORK).every((name) => known(a[name]) && known(b[name]))) {
      const beyond = (c) => c.bytes - price.bytes_per_step * c.steps - price.bytes_per_prim * c.prims;
      const [mine, other] = [price.structures[a.spec], price.structures[b.spec]], rays = price.rays[a.rays_label], mean = rays * (mine + other) / 2;
      const whole = (c) => rays * (price.steps * c.steps + price.prims * c.prims + price.bytes * beyond(c));
      parts = {
        steps: mean * price.steps * (a.steps - b.steps), prims: mean * price.prims * (a.prims - b.prims), bytes: mean * price.bytes * (beyond(a) - beyond(b)),
        each: (mine - other) * (whole(a) + whole(b)) / 2,
      };
      parts.rest = a.ns - b.ns - Object.values(parts).reduce((sum, v) => sum + v, 0);
    }
    return { a, b, price, parts };
  }

  show() {
    const place = document.getElementById("explanation"), found = this.gap();
    if (!found) {
      place.replaceChildren(element("p", { class: "note" }, "These two were not timed on the same rays."));
      return;
    }
    const { a, b, price, parts } = found, gap = a.ns - b.ns;
    const names = { ...WORK, bytes: "bytes beyond those of visits and tests", each: "time per each visit, test and byte", rest: "not explained by the model" };
    const ratio = a.ns >= b.ns ? `${figure(a.ns / b.ns, 3)} times as long` : `${figure(b.ns / a.ns, 3)} times as fast`;
    const said = [`${a.spec} takes ${figure(a.ns, 3)} ns per ${a.rays_label} ray on ${a.label}, ${b.spec} ${figure(b.ns, 3)} ns: ${ratio}.`];
    if (parts && gap !== 0) {
      const most = Object.keys(parts).reduce((x, y) => (parts[y] / gap > parts[x] / gap ? y : x));
      const share = 100 * parts[most] / gap;
      const part = share > 100.5 ? "More than all" : share > 99.5 ? "Nearly all" : `${figure(share, 2)} %`;
      const why = most === "each" ? `: ${a.spec} pays ${figure(price.structures[a.spec], 2)} times the usual price, ${b.spec} ${figure(price.structures[b.spec], 2)} times`
        : most === "rest" ? "" : `: ${figure(a[most], 3)} a ray against ${figure(b[most], 3)}`;
      said.push(`${part} of the difference is ${names[most]}${why}.`);
    } else if (!parts) {
      const silent = [a, b].filter((c) => !known(c.steps)).map((c) => c.spec);
      said.push(silent.length ? `${silent.join(" and ")} cannot count, so the gap cannot be split; embree_topology is Embree's builder under a traversal that counts.` : "Too few cases count on this scene for prices.");
    }
    const rows = Object.entries(WORK).map(([name, title]) => {
      const have = known(a[name]) && known(b[name]);
      return element("tr", {}, element("th", { scope: "row" }, parts ? element("span", { class: "swatch", style: `background:${COLOURS[name]}` }) : null, `${title} per ray`),
        element("td", { class: "number", "data-part": name }, parts ? signed(parts[name]) : "–"),
        ...[a, b].map((c) => element("td", { class: "number" }, known(c[name]) ? figure(c[name], 4) : "not counted")),
        element("td", { class: "number" }, have && b[name] ? `${figure(a[name] / b[name], 3)}×` : "–"),
        ...[a, b].map((c) => element("td", { class: "number" }, known(c[name]) && c[name] > 0 ? `${figure(c.ns / c[name], 3)} ns` : "–")));
    });
    for (const [name, title] of parts ? [["each", "time per each"], ["rest", "not explained"]] : [])
      rows.push(element("tr", {}, element("th", { scope: "row" }, element("span", { class: "swatch", style: `background:${COLOURS[name]}` }), title),
        element("td", { class: "number", "data-part": name }, signed(parts[name])), ...Array.from({ length: 5 }, () => element("td", { class: "number none" }, ""))));
    const heads = ["", "part of the gap", a.spec, b.spec, "ratio", `${a.spec}: of each`, `${b.spec}: of each`];
    place.replaceChildren(element("div", { class: "gap" },
      element("p", { class: "verdict" }, said.join(" ")),
      parts ? this.bar(parts, names) : null,
      element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Counts and times of both" },
        element("table", { class: "plain" }, element("thead", {}, element("tr", {}, ...heads.map((h, at) => element("th", { scope: "col", class: at ? "number" : null }, h)))), element("tbody", {}, ...rows))),
      price ? element("p", { class: "note" },
        `Prices on ${a.label}, fitted over ${price.cases} cases (median error ${figure(100 * price.error, 2)} %): ${figure(price.steps, 3)} ns a visit and ${figure(price.prims, 3)} ns a test, with the bytes they usually touch; ${figure(price.bytes, 3)} ns a byte beyond; times a factor of the rays (${a.rays_label}: ${figure(price.rays[a.rays_label], 2)}) and one of the structure. “Time per each” is what differs by the structures' factors, “not explained” what the model leaves.`) : null));
  }

  bar(parts, names) {
    const sum = Object.values(parts).reduce((s, v) => s + Math.abs(v), 0) || 1;
    const room = document.getElementById("explanation").clientWidth;
    return element("div", { class: "bar", role: "img", "aria-label": Object.entries(parts).map(([k, v]) => `${names[k]}: ${signed(v)}`).join(", ") },
      ...Object.entries(parts).filter(([, v]) => Math.abs(v) > 0).map(([name, v]) => {
        const share = Math.abs(v) / sum, text = `${{ each: "time per each", rest: "not explained" }[name] || names[name]} ${signed(v)}`;
        return element("span", { class: name, style: `flex:${Math.max(0.004, share)}`, title: `${names[name]}: ${signed(v)}` }, 7.5 * text.length < share * room ? text : "");
      }));
  }
}

const COLOURS = { steps: "#0072b2", prims: "#b24c00", bytes: "#007a5a", each: "#7a4fa3", rest: "#66707c" };
const signed = (ns) => `${ns < 0 ? "−" : "+"}${figure(Math.abs(ns), 3)} ns`;
