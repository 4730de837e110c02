// Tables that sort, filter, and show ratios to a pinned structure.

const FIRST = 60; // rows shown before the reader asks for more
const PRINTED = 1000; // at most, on paper
const bySame = (row) => [row.run, row.label, row.rays_label, row.threads].join("\u0000");

// A long name(key=value) may break after its parenthesis and commas.
const breakable = (text) => text.split(/(?<=[(,])/).flatMap((part, at) => (at ? [element("wbr"), part] : [part]));

class DataTable {
  constructor(place, name, columns, rows, actions) {
    Object.assign(this, { place, name, columns, rows, actions, limit: FIRST });
    this.render();
  }

  // {key, down}: which column sorts, and whether from large to small.
  get sorting() {
    const [table, key, way] = state.sort.split(":");
    return table === this.name ? { key, down: way === "down" } : null;
  }

  // The pinned structure's row beside this one.
  anchors() {
    if (!state.anchor) return null;
    const found = new Map();
    for (const row of this.rows) if (row.spec === state.anchor) found.set(bySame(row), row);
    return found;
  }

  value(row, column, anchor) {
    if (column.kind === "interval") return row.lo_ns;
    const value = row[column.key];
    if (!anchor || !column.better || !known(value)) return value;
    if (column.key === "rate" && row.anchor === state.anchor && row.anchor_ns) return row.anchor_ns / row.median_ns;
    if (column.key === "median_ns" && row.anchor === state.anchor && row.anchor_ns) return row.median_ns / row.anchor_ns;
    return known(anchor[column.key]) && anchor[column.key] !== 0 ? value / anchor[column.key] : null;
  }

  text(row, column, anchor) {
    if (column.kind === "interval")
      return known(row.lo_ns) && known(row.hi_ns) ? `${figure(row.lo_ns, 4)} to ${figure(row.hi_ns, 4)}` : "–";
    const value = this.value(row, column, anchor);
    if (!known(value)) return "–";
    if (column.key === "status" && row.status === "timed" && !row.note) return "–";
    if (column.key === "status" && row.status !== "skipped" && row.note) return `${value}: ${row.note}`; // why it was skipped stands above
    if (column.kind === "text") return String(value);
    if (column.kind === "share") return value === 0 ? "0" : `${Number((100 * value).toPrecision(2))} %`;
    if (column.kind === "count") return Math.round(value).toLocaleString("en-US");
    if (anchor && column.better) return `${figure(value, 3)}×`;
    return figure(value * column.factor, column.digits);
  }

  sorted(rows, anchors) {
    const sorting = this.sorting;
    if (!sorting) return rows;
    const column = this.columns.find((c) => c.key === sorting.key);
    if (!column) return rows;
    const way = sorting.down ? -1 : 1;
    const keyed = rows.map((row) => [this.value(row, column, anchors && anchors.get(bySame(row))), row]);
    keyed.sort(([a], [b]) => {
      if (!known(a) || !known(b)) return known(a) ? -1 : known(b) ? 1 : 0; // nothing known: always last
      return way * (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
    });
    return keyed.map(([, row]) => row);
  }

  visible() {
    return this.sorted(filtered(this.rows), this.anchors());
  }

  head(column) {
    const sorting = this.sorting;
    const mine = sorting && sorting.key === column.key;
    const numeric = column.kind !== "text";
    const click = () => {
      const down = mine ? !sorting.down : numeric && column.better !== "low";
      choose({ sort: mine && sorting.down !== (numeric && column.better !== "low") ? "" : `${this.name}:${column.key}:${down ? "down" : "up"}` });
    };
    return element(
      "th",
      { scope: "col", class: [numeric ? "number" : "", column.paper ? "" : "screen"].filter(Boolean).join(" ") || null, "aria-sort": mine ? (sorting.down ? "descending" : "ascending") : null, title: column.help || null },
      element("button", { type: "button", onclick: click, "data-sort": column.key }, column.head, mine ? (sorting.down ? " ↓" : " ↑") : ""),
    );
  }

  cell(row, column, anchor) {
    const text = this.text(row, column, anchor);
    if (column.key === "spec") {
      const pinned = row.spec === state.anchor;
      return element(
        "th", { scope: "row" },
        element("button", {
          type: "button", class: "pin", "aria-pressed": String(pinned), "data-pin": row.spec, title: pinned ? "Show plain numbers again" : `Show ratios to ${row.spec}`,
          "aria-label": `Pin ${row.spec}`, onclick: () => choose({ anchor: pinned ? "" : row.spec }),
        }, pinned ? "◉" : "◎"),
        " ", ...breakable(text), " ",
        this.actions.why && this.actions.why(row)
          ? element("button", { type: "button", class: "why", "data-why": row.spec, "aria-label": `Why is ${row.spec} as fast as it is on ${row.label}?`, onclick: () => this.actions.explain(row) }, "why?")
          : null,
      );
    }
    const numeric = column.kind !== "text";
    const long = column.kind === "text" && text.length > 40;
    const kinds = [numeric ? "number" : "", column.paper ? "" : "screen", text === "–" ? "none" : "", long ? "wrap" : "", anchor && column.better ? "ratio" : ""].filter(Boolean).join(" ");
    return element("td", { class: kinds || null, title: column.key === "status" && row.note ? row.note : null }, text);
  }

  render(limit = this.limit) {
    const anchors = this.anchors();
    const rows = this.visible();
    const shown = rows.slice(0, limit);
    const columns = this.columns.filter((c) => !["number", "count"].includes(c.kind) || this.rows.some((row) => known(row[c.key])));
    const body = shown.map((row) => {
      const anchor = anchors && anchors.get(bySame(row));
      const kinds = [row.status, row.spec === state.anchor ? "pinned" : ""].filter(Boolean).join(" ");
      return element("tr", { class: kinds }, ...columns.map((column) => this.cell(row, column, anchor)));
    });
    const focus = this.place.contains(document.activeElement) && document.activeElement.dataset;
    const label = this.name === "rays" ? "All cases" : "Structures";
    this.place.replaceChildren(
      element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label },
        element("table", { id: `table-${this.name}` },
          element("thead", {}, element("tr", {}, ...columns.map((column) => this.head(column)))),
          element("tbody", {}, ...body))),
      element("div", { class: "more" },
        element("span", {}, shown.length < rows.length ? `${shown.length} of ${rows.length.toLocaleString("en-US")} rows` : `${rows.length.toLocaleString("en-US")} rows`),
        shown.length < rows.length ? element("button", { type: "button", onclick: () => { this.limit += 240; this.render(); } }, "Show more") : null,
        shown.length < rows.length ? element("button", { type: "button", onclick: () => { this.limit = Infinity; this.render(); } }, "Show all") : null,
        element("button", { type: "button", class: "quiet", "data-table-csv": this.name, onclick: () => download(`${this.name}.csv`, this.csv(), "text/csv") }, "CSV")),
    );
    const again = focus && (focus.sort ? this.place.querySelector(`[data-sort="${focus.sort}"]`) : focus.pin && [...this.place.querySelectorAll("[data-pin]")].find((b) => b.dataset.pin === focus.pin));
    if (again) again.focus({ preventScroll: true });
  }

  // As stored, not as rounded; all rows that pass the filters.
  csv() {
    const names = this.rows.length ? Object.keys(this.rows[0]) : [];
    return toCsv(this.visible(), names);
  }
}
