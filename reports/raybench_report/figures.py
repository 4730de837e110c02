"""Figures (PDF, SVG, PNG) and tables (LaTeX, Markdown) for a paper, from the charts and tables of the page."""

import json
import re
import textwrap

import pandas as pd
import vl_convert

from . import tables
from .charts import vega
from .results import NULL, RunError, write_atomically

COLUMN = 240  # points: one column of a two-column paper (ACM 241, IEEE 252)
STEP = 10  # points a row
ANY = " (any hit)"  # left out of legends, for room


def write(folder, report, sections):
    """Writes all of them into `folder`. Returns what to say. Throws RunError, OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = 0
    for chart in (chart for section in sections for chart in section.charts):
        rows = select(report, chart)
        if rows.empty:
            continue
        _save(folder, chart, rows)
        drawn += 1
    written = list(_tables(report, sections))
    for table in written:
        _text(folder / f"{table.name}.tex", latex(table))
        _text(folder / f"{table.name}.md", markdown(table))
    if not drawn and not written:
        raise RunError(f"{folder}: nothing to draw")
    return f"{drawn} figures (PDF, SVG, PNG, CSV) and {len(written)} tables (LaTeX, Markdown) in {folder}\n"


def select(report, chart):
    """The rows that a chart draws without filters: as the page does it."""
    rows = chart.rows
    if isinstance(rows, str):
        rows = report.queries if rows == "queries" else report.builds
        rows = rows[(rows["structure"] != NULL) & (rows["status"] != "skipped")]
        if chart.rows == "queries":
            rows = rows[(rows["status"] == "timed") & (rows["order"] != "shuffled")]
    if chart.single and not rows.empty:
        values = set(rows[chart.single])
        rows = rows[rows[chart.single] == next((s for s in report.ray_sets if s in values), rows[chart.single].iloc[0])]
    return rows


def specification(chart, rows):
    """The chart in Vega-Lite, one column of a paper wide."""
    names = chart.height is None
    longest = max((len(str(s)) for s in rows[vega.rows_field(chart.panel)]), default=0) if names else 0
    width = COLUMN - (min(110, 4.6 * longest) + 14 if names else 44) - 8
    panel = json.loads(re.sub(r", (left|right|down) is \w+", "", json.dumps(chart.panel)))  # short titles fit a column
    panel |= {"width": width, "height": {"step": STEP} if names else round(0.5 * chart.height)}
    for axis, span in chart.spans.items():
        values = rows[span["of"]].to_numpy(dtype=float) * span["factor"]
        values = values[(values > 0) & (values < 1e299)]
        if len(values):
            found = vega.ticks(values.min(), values.max(), (width if axis == "x" else panel["height"]) / 26)
            for layer in panel.get("layer", [panel]) if found else []:
                place = layer.get("encoding", {}).get(axis, {})
                if place.get("scale", {}).get("type") == "log":
                    place["axis"] = place.get("axis", {}) | {"values": found, "labelOverlap": False}
    for layer in panel.get("layer", [panel]):
        place = layer.get("encoding", {}).get("x", {})
        if isinstance(place.get("title"), str):
            place["title"] = _lines(place["title"], max(12, int(width / 4.4)))
    theme = vega.config("print")
    entries = _entries(panel)
    across = max(1, int(COLUMN / (4.4 * max(map(len, entries), default=10) + 18)))
    theme["legend"]["columns"] = across
    if entries:
        _set_legend(panel, _left_of(COLUMN - width - 8, -(-len(entries) // across), across) if names else {})
    values = json.loads(rows.to_json(orient="records", double_precision=15))
    whole = {"data": {"name": "rows", "values": values}, "config": theme, "padding": 2, "background": "white"}
    if not chart.facet:
        return whole | panel
    order = [v for v in dict.fromkeys(rows[chart.facet])]
    facet = {"field": chart.facet, "type": "nominal", "sort": order, "header": {"title": None}}
    return whole | {"facet": facet, "columns": 1, "spec": panel, "resolve": chart.resolve}


def _lines(title, most):
    """An axis' title in lines of at most so many letters: broken before its parenthesis where that suffices."""
    if len(title) <= most:
        return [title]
    return [line for part in title.replace(" (", "\n(", 1).split("\n") for line in textwrap.wrap(part, most)]


def drawn(chart, rows):
    """The chart as SVG, no wider than a column: drawn again, narrower, where its labels take more room than was thought."""
    spec = specification(chart, rows)
    svg = vl_convert.vegalite_to_svg(spec)
    over = float(re.search(r'<svg[^>]*\swidth="([\d.]+)"', svg)[1]) - COLUMN
    if over > 0:
        (spec["spec"] if "spec" in spec else spec)["width"] -= over
        svg = vl_convert.vegalite_to_svg(spec)
    return svg


def _entries(panel):
    """Names in a chart's legends."""
    encodings = [layer.get("encoding", {}) for layer in panel.get("layer", [panel])]
    found = [
        e[c]["scale"]["domain"]
        for e in encodings
        for c in ("color", "shape")
        if "domain" in e.get(c, {}).get("scale", {})
    ]
    return list(dict.fromkeys(str(name).removesuffix(ANY) for names in found for name in names))


def _left_of(left, lines, across):
    """Where a legend has the whole column's width: above the names of the rows."""
    return {
        "orient": "none", "legendX": -left, "legendY": -(11 * lines + 32), "columns": across, "direction": "horizontal",
    }  # fmt: skip


def _set_legend(panel, place):
    """Puts the legends there, in short names."""
    place = {"labelExpr": f"replace(datum.label, '{ANY}', '')"} | place
    for layer in panel.get("layer", [panel]):
        for channel in ("color", "shape"):
            encoding = layer.get("encoding", {}).get(channel, {})
            if "scale" in encoding and encoding.get("legend", place) is not None:
                layer["encoding"][channel]["legend"] = place


def _save(folder, chart, rows):
    svg = drawn(chart, rows)
    _text(folder / f"{chart.name}.svg", svg)
    for suffix, data in (("pdf", vl_convert.svg_to_pdf(svg)), ("png", vl_convert.svg_to_png(svg, scale=4))):
        write_atomically(folder / f"{chart.name}.{suffix}", lambda path, data=data: path.write_bytes(data))
    write_atomically(
        folder / f"{chart.name}.csv", lambda path: rows[chart.columns].to_csv(path, index=False, lineterminator="\n")
    )


def _text(path, text):
    write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


class PaperTable:
    """Heads and rows of text; `numeric` says which columns are numbers. A row of one cell is a heading of its block."""

    def __init__(self, name, caption, heads, rows, numeric):
        self.name, self.caption, self.heads, self.rows, self.numeric = name, caption, heads, rows, numeric


def _tables(report, sections):
    """All tables of the paper."""
    if report.runs:
        yield _structures(report)
        if not report.timed_queries.empty:
            yield _speeds(report)
    for section in sections:
        for table in section.tables:
            from .page import cell  # numbers as on the page

            rows = [[cell(v) for v in row] for row in table.rows]
            yield PaperTable(table.name, table.title, table.heads, rows, table.numeric)


def _structures(report):
    """Verdict, build, memory and speed by scene."""
    columns = [c for c in tables.STRUCTURES if c.paper and c.key not in ("run", "label")]
    rows = []
    for (run, label), here in tables.structures(report).groupby(["run", "label"], sort=False):
        rows.append([label if len(report.runs) == 1 else f"{label}, {run}"])
        rows += [[_short(tables.shown(row, column)) for column in columns] for _, row in here.iterrows()]
    heads = [c.head for c in columns]
    return PaperTable("structures", "Structures", heads, rows, [c.kind != "text" for c in columns])


def _short(text):
    """Without why something was skipped or refused, which no column has room for."""
    return text.partition(": ")[0] if text.startswith(("skipped: ", "REFUSED: ")) else text


def _speeds(report):
    """Million rays per second: structures down, ray sets across."""
    cases = report.timed_queries
    cases = cases[
        (cases["structure"] != NULL) & (cases["threads"] == cases["threads"].min()) & (cases["order"] != "shuffled")
    ]
    sets = [s for s in report.ray_sets if s in set(cases["rays_label"])]
    short = [s.removesuffix(" (any hit)").replace("ambient_occlusion", "ambient occlusion") for s in sets]
    rows = []
    for (run, label), here in cases.groupby(["run", "label"], sort=False):
        rows.append([label if len(report.runs) == 1 else f"{label}, {run}"])
        rates = {(r.spec, r.rays_label): r.rate for r in here.itertuples()}
        for spec in [s for s in report.order if s in set(here["spec"])]:
            values = [rates.get((spec, s)) for s in sets]
            rows.append([spec, *("–" if v is None or pd.isna(v) else tables.figure(v / 1e6, 3) for v in values)])
    return PaperTable("speed", "Million rays per second", ["structure", *short], rows, [False] + [True] * len(sets))


def markdown(table):
    """GitHub's."""

    def line(cells):
        return "| " + " | ".join(str(c).replace("|", "\\|") for c in cells) + " |"

    rule = "|" + "|".join("---:" if numeric else "---" for numeric in table.numeric) + "|"
    blank = [""] * (len(table.heads) - 1)
    rows = [line([f"**{row[0]}**", *blank]) if len(row) == 1 else line(row) for row in table.rows]
    return "\n".join([line(table.heads), rule, *rows]) + "\n"


def latex(table):
    """A tabular for \\input, with booktabs' rules."""
    columns = "".join("r" if numeric else "l" for numeric in table.numeric)
    lines = [
        f"% {table.caption}. Needs \\usepackage{{booktabs}}; for \\begin{{table*}} ... \\input{{{table.name}}} ... \\end{{table*}}.",
        "\\footnotesize\\setlength{\\tabcolsep}{4pt}",
        f"\\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        "\\toprule",
    ]
    lines += [
        " & ".join(_head(head, numeric) for head, numeric in zip(table.heads, table.numeric, strict=True)) + " \\\\"
    ]
    lines.append("\\midrule")
    for at, row in enumerate(table.rows):
        if len(row) == 1:
            lines += (["\\addlinespace"] if at else []) + [
                f"\\multicolumn{{{len(table.heads)}}}{{@{{}}l}}{{\\textit{{{_escaped(row[0])}}}}} \\\\"
            ]
        else:
            lines.append(" & ".join(_escaped(cell) for cell in row) + " \\\\")
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}"]) + "\n"


def _head(text, numeric):
    """A column's head, a word a line, so that columns of numbers stay narrow."""
    words = _escaped(text).split()
    if not numeric or len(words) < 2:
        return " ".join(words)
    return "\\shortstack[r]{" + " \\\\ ".join(words) + "}"


_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "×": r"$\times$", "–": "--", "²": r"\textsuperscript{2}", "<": r"$<$", ">": r"$>$",
}  # fmt: skip


def _escaped(text):
    return re.sub(r"[\\&%$#_{}~^×–²<>]", lambda found: _LATEX[found[0]], str(text))
