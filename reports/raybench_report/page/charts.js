// Charts: Vega-Lite panels as the report defines them, drawn in the reader's width, theme and filters.

const NARROWEST = 230, GAP = 24; // pixels

// Ticks of a logarithmic axis, as charts/vega.py has them: 1, 2, 5 in each decade, or powers of ten where those are too many.
const logTicks = (rows, span, most) => {
  const values = rows.flatMap((row) => span.of.map((name) => row[name] * span.factor)).filter((v) => v > 0 && v < INFINITE);
  const low = values.reduce((a, b) => Math.min(a, b), Infinity), high = values.reduce((a, b) => Math.max(a, b), 0);
  if (!(low < high)) return null;
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high)), fine = [], coarse = [];
  const step = Math.ceil((last - first + 1) / most);
  for (let d = first; d <= last; ++d) {
    for (const m of [1, 2, 5]) {
      const tick = Number(`${m}e${d}`);
      if (tick >= low * 0.9 && tick <= high * 1.1) fine.push(tick);
    }
    if (d % step === 0) coarse.push(Number(`1e${d}`));
  }
  return fine.length < 2 ? null : fine.length <= most ? fine : coarse;
};
const setTicks = (panel, axis, values) => {
  if (!values) return;
  for (const layer of panel.layer || [panel]) {
    const scale = layer.encoding && layer.encoding[axis];
    if (scale && scale.scale && scale.scale.type === "log") scale.axis = { ...scale.axis, values, labelOverlap: false };
  }
};

// The column that colours stand for, and its values.
const colours = (panel) => {
  for (const layer of panel.layer || [panel]) {
    const colour = layer.encoding && layer.encoding.color;
    if (colour && colour.field && colour.scale && colour.scale.domain) return { field: colour.field, domain: colour.scale.domain };
  }
  return null;
};

class Charts {
  constructor(data, rowsOf) {
    this.rowsOf = rowsOf; // name of common rows → rows
    this.charts = data.charts.map((chart) => ({
      ...chart, own: typeof chart.rows === "string" ? null : unpack(chart.rows), box: document.getElementById(chart.name), dirty: true, view: null,
    }));
    this.themes = data.themes;
    this.visible = new Set();
    const observer = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const chart = this.charts.find((c) => c.box === entry.target);
        if (entry.isIntersecting) this.visible.add(chart);
        else this.visible.delete(chart);
      }
      this.work();
    }, { rootMargin: "300px" });
    for (const chart of this.charts) {
      observer.observe(chart.box);
      chart.box.querySelector("[data-csv]").addEventListener("click", () => download(`${chart.name}.csv`, this.csv(chart), "text/csv"));
      chart.box.querySelector("[data-svg]").addEventListener("click", async () => {
        if (chart.view) download(`${chart.name}.svg`, await chart.view.toSVG(), "image/svg+xml");
      });
    }
    let width = innerWidth;
    addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; this.redraw(); } });
  }

  redraw() {
    for (const chart of this.charts) chart.dirty = true;
    this.work();
  }

  // What is in sight first, then the rest, one chart at a time, so that the page stays responsive.
  async work() {
    if (this.working) return;
    this.working = true;
    for (;;) {
      const next = this.charts.find((c) => c.dirty && this.visible.has(c)) || this.charts.find((c) => c.dirty);
      if (!next) break;
      if (!this.visible.has(next)) await new Promise((done) => (window.requestIdleCallback || setTimeout)(done, { timeout: 400 }));
      next.dirty = false;
      await this.draw(next);
    }
    this.working = false;
    document.documentElement.dataset.charts = "drawn";
  }

  source(chart) {
    return chart.own || this.rowsOf(chart.rows);
  }

  // The rows drawn, and what is said about the choice.
  chosen(chart) {
    let rows = filtered(this.source(chart));
    const said = [];
    if (!state.rays && rows.some((row) => row.order === "shuffled")) { // they would stand on the others
      rows = rows.filter((row) => row.order !== "shuffled");
      said.push("Shuffled copies of ray sets are left out; choose one above.");
    }
    if (chart.single) {
      const values = [...new Set(rows.map((row) => row[chart.single]))];
      const first = values.includes(state.rays) ? state.rays : DATA.raySets.find((s) => values.includes(s)) || values[0];
      rows = rows.filter((row) => row[chart.single] === first);
      if (values.length > 1) said.push(`Shown: ${first} rays; choose others above.`);
    }
    return { rows, said };
  }

  csv(chart) {
    return toCsv(this.chosen(chart).rows, chart.columns);
  }

  async draw(chart) {
    const place = chart.box.querySelector(".draw");
    const { rows, said } = this.chosen(chart);
    const all = chart.facet ? [...new Set(rows.map((row) => row[chart.facet]))] : [""];
    const panels = all.slice(0, chart.most);
    if (panels.length < all.length) said.push(`Shown: ${panels.length} of ${all.length}; choose one above.`);
    chart.box.querySelector(".more").textContent = said.join(" ");
    if (chart.view) chart.view.finalize();
    chart.view = null;
    if (!rows.length) {
      place.replaceChildren(element("p", { class: "note" }, "Nothing to draw under these filters."));
      return;
    }
    const drawn = chart.facet ? rows.filter((row) => panels.includes(row[chart.facet])) : rows;
    try {
      const spec = this.spec(chart, drawn, panels, place.clientWidth);
      let svg = await this.embed(chart, place, spec);
      const over = svg.width.baseVal.value - place.clientWidth;
      if (over > 0) { // labels took more room than was thought
        const panel = spec.spec || spec;
        panel.width = Math.max(100, panel.width - Math.ceil(over / (spec.columns || 1)) - 1);
        chart.view.finalize();
        svg = await this.embed(chart, place, spec);
      }
      if (svg.width.baseVal.value > place.clientWidth) place.tabIndex = 0; // scrolled by keyboard, too
      else place.removeAttribute("tabindex");
    } catch (error) {
      place.replaceChildren(element("p", { class: "warn" }, `This chart could not be drawn: ${error.message}`));
      console.error(chart.name, error);
    }
  }

  async embed(chart, place, spec) {
    const inner = element("div", { "aria-hidden": "true" }); // the box has a label, and the table under CSV has the numbers
    place.replaceChildren(inner);
    const result = await vegaEmbed(inner, spec, { actions: false, renderer: "svg", mode: "vega-lite", logLevel: 1, tooltip: { theme: "custom" } });
    chart.view = result.view;
    return inner.querySelector("svg");
  }

  // The panel, repeated for each value of the facet in as many columns as fit.
  spec(chart, rows, panels, room) {
    const theme = structuredClone(this.themes[theming()]);
    const names = !chart.height;
    const field = names && (chart.panel.layer || [chart.panel]).find((layer) => layer.encoding.y).encoding.y.field;
    const longest = names ? rows.reduce((most, row) => Math.max(most, String(row[field] || "").length), 0) : 0;
    const limit = room < 500 ? room / 2 : chart.facet ? 190 : 380;
    theme.axis.labelLimit = limit;
    const apart = chart.resolve.scale && chart.resolve.scale.y === "independent";
    const margin = names ? Math.min(limit, longest * 6.6) + 14 : 58;
    const series = colours(chart.panel), drawn = series ? series.domain.filter((name) => rows.some((row) => row[series.field] === name)) : [];
    const widest = drawn.reduce((most, name) => Math.max(most, String(name).length), 12);
    theme.legend.columns = Math.max(1, Math.floor((room - margin) / (6.2 * widest + 26)));
    if (room < 500) theme.legend.layout = { top: { direction: "vertical", anchor: "start" } }; // two legends below each other
    const fit = apart ? Math.floor((room + GAP) / (NARROWEST + margin + GAP)) : Math.floor((room - margin + GAP) / (NARROWEST + GAP));
    const across = Math.max(1, Math.min(panels.length, fit, 3));
    const columns = panels.length === 4 && across === 3 ? 2 : across;
    const each = apart ? (room - GAP * (columns - 1)) / columns - margin : (room - margin - GAP * (columns - 1)) / columns;
    const width = Math.max(120, Math.min(names ? 620 : 560, Math.floor(each) - 14));
    theme.header.labelLimit = width + margin - 10;
    theme.axisX.titleLimit = width + 20;
    const panel = { ...structuredClone(chart.panel), width, height: names ? { step: chart.step } : chart.height };
    for (const layer of panel.layer || [panel]) {
      const x = layer.encoding && layer.encoding.x; // a long title is cut, but on several lines it is not
      if (x && typeof x.title === "string" && 6.4 * x.title.length > width) x.title = x.title.split(/ (?=\()/);
    }
    if (drawn.length) {
      for (const layer of panel.layer || [panel]) {
        for (const name of ["color", "shape", "strokeDash"]) {
          const channel = layer.encoding && layer.encoding[name];
          if (channel && channel.field === series.field) channel.legend = { ...channel.legend, values: drawn };
        }
      }
    }
    for (const [axis, span] of Object.entries(chart.spans)) setTicks(panel, axis, logTicks(rows, span, axis === "x" ? width / 42 : chart.height / 30));
    const whole = { data: { name: "rows", values: rows.map((row) => ({ ...row })) }, config: theme, padding: 2 };
    if (!chart.facet) return { ...whole, ...panel };
    return {
      ...whole, columns, resolve: chart.resolve, spec: panel,
      facet: { field: chart.facet, type: "nominal", sort: panels, header: { title: null } },
    };
  }
}
