// The data: unpacked once; rows as objects where a table or chart asks for them.

const inflate = async (id) => {
  const text = document.getElementById(id).textContent.trim();
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
};

// Columns {name: {v} or {d, i}} as rows.
const unpack = (columns) => {
  if (!columns) return [];
  const names = Object.keys(columns);
  if (!names.length) return [];
  const first = columns[names[0]];
  const rows = Array.from({ length: (first.v || first.i).length }, () => ({}));
  for (const name of names) {
    const { v, d, i } = columns[name];
    if (v) v.forEach((value, at) => { rows[at][name] = value; });
    else i.forEach((code, at) => { rows[at][name] = d[code]; });
  }
  return rows;
};

const INFINITE = 1e299; // JSON has no infinity; larger numbers stand for it
const csvField = (value) => {
  if (value === null || value === undefined) return "";
  if (typeof value === "number") return Math.abs(value) > INFINITE ? (value > 0 ? "inf" : "-inf") : String(value);
  const text = String(value);
  return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
};
const toCsv = (rows, columns) =>
  [columns.join(","), ...rows.map((row) => columns.map((c) => csvField(row[c])).join(","))].join("\n") + "\n";

const download = (name, text, type) => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 5000);
};

// Significant digits without an exponent: 0.0123, 4.56, 78.9, 1,230.
const figure = (value, digits) => {
  if (value === 0) return "0";
  if (Math.abs(value) > INFINITE) return "∞";
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toLocaleString("en-US", { minimumFractionDigits: Math.min(places, 20), maximumFractionDigits: Math.min(places, 20) });
};
const known = (value) => value !== null && value !== undefined && value !== "";

// An element with attributes and children; text is never parsed as HTML.
const element = (tag, attributes = {}, ...children) => {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((c) => c !== null && c !== undefined));
  return made;
};
const options = (select, values, chosen) => {
  select.replaceChildren(...values.map(([value, text]) => element("option", { value }, text)));
  select.value = values.some(([value]) => value === chosen) ? chosen : values.length ? values[0][0] : "";
};
