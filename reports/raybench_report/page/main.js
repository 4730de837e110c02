// Puts the page together.

let DATA = null;

// The theme in force: what the reader chose, else what the system says.
const THEMES = ["auto", "light", "dark"];
let theme = "auto";
try { theme = localStorage.getItem("raybench-theme") || "auto"; } catch { /* files may have no storage */ }
const dark = matchMedia("(prefers-color-scheme: dark)");
const theming = () => (theme === "auto" ? (dark.matches ? "dark" : "light") : theme);
const paintTheme = () => {
  document.documentElement.dataset.theme = theming();
  document.getElementById("theme").textContent = `Theme: ${theme}`;
};
paintTheme();

const notice = (text) => {
  const place = document.getElementById("notice");
  place.textContent = text;
  place.classList.add("shown");
  setTimeout(() => place.classList.remove("shown"), 1800);
};

const goTo = (part) => {
  const place = document.getElementById(part);
  if (!place) return;
  target = part;
  history.replaceState(null, "", address(part));
  place.scrollIntoView();
};

const main = async () => {
  readAddress();
  DATA = JSON.parse(await inflate("data"));
  const cases = unpack(DATA.cases), structures = unpack(DATA.structures);
  const form = document.getElementById("filters");
  const common = {
    queries: cases.filter((c) => c.query !== "build" && c.status === "timed" && c.structure !== DATA.null),
    builds: cases.filter((c) => c.query === "build" && c.structure !== DATA.null && c.status !== "skipped"),
  };
  const parts = [];
  let tables = [];

  if (form) {
    const fields = form.elements;
    const fill = () => {
      const all = (values, word) => [["", word], ...values.map((v) => [v, v])];
      if (fields.run) options(fields.run, all(DATA.runs, "all"), state.run);
      options(fields.scene, all(DATA.scenes, "all"), state.scene);
      options(fields.spec, all(DATA.order, "all"), state.spec);
      options(fields.rays, all(DATA.raySets, "all"), state.rays);
      options(fields.anchor, all(DATA.order, "none"), state.anchor);
      if (fields.q.value !== state.q) fields.q.value = state.q;
      for (const select of form.querySelectorAll("select")) select.classList.toggle("set", select.value !== "");
    };
    fill();
    listeners.push(fill);
    for (const select of form.querySelectorAll("select")) select.addEventListener("change", () => choose({ [select.name]: select.value }));
    let waiting = 0;
    fields.q.addEventListener("input", () => {
      clearTimeout(waiting);
      waiting = setTimeout(() => choose({ q: fields.q.value }), 120);
    });
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("reset", (event) => { event.preventDefault(); choose({ ...EMPTY }); });
    document.getElementById("copy-link").addEventListener("click", () => copy(location.href));
    const explain = document.getElementById("explain") && new Explain(DATA.panels.explain.prices, cases);
    const actions = {
      why: (row) => explain && explain.rows.some((c) => c.spec === row.spec && c.label === row.label && (!row.run || c.run === row.run)),
      explain: (row) => explain.ask(row),
    };
    const asked = cases.filter((c) => c.query !== "build" && c.structure !== DATA.null);
    const place = (list) => new Map(list.map((name, at) => [name, at]));
    const [scenes, sets, order, runs] = [place(DATA.scenes), place(DATA.raySets), place(DATA.order), place(DATA.runs)];
    asked.sort((a, b) => scenes.get(a.label) - scenes.get(b.label) || sets.get(a.rays_label) - sets.get(b.rays_label) || order.get(a.spec) - order.get(b.spec) || runs.get(a.run) - runs.get(b.run));
    tables = [
      new DataTable(document.querySelector('[data-table="structures"]'), "structures", DATA.tables.structures, structures, actions),
      new DataTable(document.querySelector('[data-table="rays"]'), "rays", DATA.tables.rays, asked, actions),
    ];
    const count = () => {
      const shown = filtered(asked).length;
      document.getElementById("count").textContent = shown === asked.length ? `${shown.toLocaleString("en-US")} cases` : `${shown.toLocaleString("en-US")} of ${asked.length.toLocaleString("en-US")} cases`;
    };
    count();
    listeners.push((changes) => {
      for (const table of tables) {
        if (!("sort" in changes)) table.limit = FIRST;
        table.render();
      }
      count();
    });
    if (explain) listeners.push((changes) => ("why" in changes || "scene" in changes || "rays" in changes) && explain.follow());
  }
  if (document.getElementById("gallery")) {
    const pictures = new Pictures(DATA.panels.pictures);
    listeners.push((changes) => ("scene" in changes || "pick" in changes) && pictures.follow());
    parts.push(() => pictures.show());
  }

  document.documentElement.dataset.tables = "ready";
  // The library comes last: tables work before it is there.
  const library = element("script");
  library.textContent = await inflate("library");
  document.head.append(library);
  for (const id of ["library", "data"]) document.getElementById(id).remove();
  const charts = new Charts(DATA, (name) => common[name]);
  const drawing = (changes) => { if (!["sort", "why", "pick"].some((k) => k in changes && Object.keys(changes).length === 1)) charts.redraw(); };
  listeners.push(drawing);
  charts.work();

  const rethemed = () => { paintTheme(); charts.redraw(); for (const part of parts) part(); };
  document.getElementById("theme").addEventListener("click", () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    try { localStorage.setItem("raybench-theme", theme); } catch { /* files may have no storage */ }
    rethemed();
  });
  dark.addEventListener("change", rethemed);

  for (const link of document.querySelectorAll("[data-link]")) {
    link.addEventListener("click", (event) => {
      event.preventDefault();
      goTo(link.dataset.link);
      copy(location.href);
    });
  }
  for (const link of document.querySelectorAll(".top nav a")) {
    link.addEventListener("click", (event) => { event.preventDefault(); goTo(link.hash.slice(1)); });
  }
  addEventListener("hashchange", () => {
    readAddress();
    for (const listener of listeners) listener({ ...EMPTY });
    const place = document.getElementById(target);
    if (place) place.scrollIntoView();
  });
  // Paper is white and shows what is closed.
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open]):not(.raw)")];
    for (const box of closed) box.open = true;
    for (const table of tables) table.render(PRINTED);
  });
  addEventListener("afterprint", () => {
    for (const box of closed) box.open = false;
    for (const table of tables) table.render();
  });
  if (target) document.getElementById(target)?.scrollIntoView();
};

const copy = async (text) => {
  try {
    await navigator.clipboard.writeText(text);
    notice("Link copied");
  } catch {
    notice("The link is in the address bar");
  }
};

main().catch((error) => {
  console.error(error);
  document.querySelector("main").prepend(element("p", { class: "warn" }, `This page could not be put together: ${error.message}`));
});
