// What the reader chose: filters, pinned structure, sorting. It stands in the address, so that a link repeats it.

const EMPTY = { run: "", scene: "", spec: "", rays: "", anchor: "", q: "", sort: "", why: "", pick: "" };
const state = { ...EMPTY };
const listeners = [];
let target = ""; // the part of the page that the address names

const readAddress = () => {
  const [part, query] = location.hash.slice(1).split("?");
  target = decodeURIComponent(part || "");
  const given = new URLSearchParams(query || "");
  for (const key of Object.keys(EMPTY)) state[key] = given.get(key) || "";
};

const address = (part) => {
  const given = new URLSearchParams();
  for (const [key, value] of Object.entries(state)) if (value) given.set(key, value);
  const query = given.toString();
  return `#${encodeURIComponent(part)}${query ? "?" + query : ""}`;
};

// Changes what was chosen and tells everyone.
const choose = (changes) => {
  Object.assign(state, changes);
  history.replaceState(null, "", address(target) === "#" ? location.pathname + location.search : address(target));
  for (const listener of listeners) listener(changes);
};

const words = () => state.q.toLowerCase().split(/\s+/).filter(Boolean);

// Whether a row passes the filters; one that lacks a column is not filtered by it.
const passes = (row, search) => {
  if (state.run && "run" in row && row.run && row.run !== state.run) return false;
  if (state.scene && "label" in row && row.label !== state.scene) return false;
  if (state.spec && "spec" in row && row.spec && row.spec !== state.spec && row.spec !== state.anchor) return false;
  if (state.rays && "rays_label" in row && row.rays_label !== state.rays) return false;
  if (!search.length) return true;
  const text = [row.run, row.label, row.spec, row.rays_label, row.status, row.verdict, row.claim, row.note, row.suite]
    .filter(Boolean).join(" ").toLowerCase();
  return search.every((word) => text.includes(word));
};
const filtered = (rows) => {
  const search = words();
  return rows.filter((row) => passes(row, search));
};
