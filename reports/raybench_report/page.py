"""report.html: the pictures, the plots and the tables on one static page."""

import html
import json

import pandas as pd

from . import predictors
from .results import VERDICTS, write_atomically

STYLE = """
body { font: 15px/1.45 sans-serif; max-width: 75em; margin: 2em auto; padding: 0 1em; color: #222; background: #fff }
h1, h2 { font-weight: 600 } h2 { margin-top: 2em }
figure { display: inline-block; vertical-align: top; margin: 0 1.5em 1.5em 0 } figcaption { font-size: 90% }
.pictures img { max-width: 24em } .plots img { width: 32em; max-width: 100% }
.sheets img { max-width: 100% }
.scroll { overflow-x: auto }
table { border-collapse: collapse; font-size: 85%; font-variant-numeric: tabular-nums }
th, td { padding: .15em .6em; text-align: left; vertical-align: top; white-space: nowrap }
th { border-bottom: 1px solid #222 }
td.number, th.number { text-align: right } tbody tr:nth-child(even) { background: #f4f4f4 }
td.none { color: #777 } tr.refused { color: #b00020 }
"""


def write(run, drawn, sheets=()):
    """Writes DIR/report.html over `drawn`, the plots' (name, title), and `sheets` of heat maps. Returns its path."""
    pictures = sorted(path.name for path in (run.directory / "images").glob("*.png"))
    parts = [
        "<!DOCTYPE html>",
        f'<html lang="en"><meta charset="utf-8"><title>raybench: {_text(run.directory.resolve().name)}</title>',
        f"<style>{STYLE}</style>",
        f"<h1>raybench: {_text(', '.join(run.scenes))}</h1>",
        f"<p>{_summary(run)}</p>",
    ]
    if pictures:
        parts.append(
            '<h2>The scenes</h2><p>The rays of these pictures were recorded and measured.</p><div class="pictures">'
        )
        parts += [figure(f"images/{name}", f"images/{name}", name.removesuffix(".png")) for name in pictures]
        parts.append("</div>")
    parts.append('<h2>Plots</h2><div class="plots">')
    parts += [figure(f"plots/{name}.svg", f"plots/{name}.png", title) for name, title in drawn]
    parts.append("</div>")
    if sheets:
        parts.append('<h2>Heat maps</h2><div class="sheets">')
        parts += [figure(f"plots/{name}.png", f"plots/{name}.png", title) for name, title in sheets]
        parts.append("</div>")
    parts += _predictors(run)
    parts += ["<h2>Builds</h2>", _table(run.builds, _BUILD_COLUMNS)]
    parts += ["<h2>Queries</h2>", _table(run.queries, _QUERY_COLUMNS)]
    parts += [
        "<h2>Machine and settings</h2>",
        f"<pre>{_text(json.dumps(run.info, indent=2, ensure_ascii=False))}</pre>",
    ]
    path = run.directory / "report.html"
    write_atomically(path, lambda temporary: temporary.write_text("\n".join(parts) + "\n", encoding="utf-8"))
    return path


def _summary(run):
    counts = run.cases["status"].value_counts()
    parts = [
        f"{counts[status]} {status}" for status in ("timed", "refused", "skipped", "interrupted") if status in counts
    ]
    return (
        f"{len(run.cases)} cases: {', '.join(parts)}. Times are medians with an interval of at least 95 %. "
        "A refused structure broke what it claims about its answers and gets no time. "
        "“–”: not counted or does not apply."
    )


def figure(shown, linked, caption):
    """A picture with its caption that links to another file."""
    return (
        f'<figure><a href="{_text(linked)}"><img src="{_text(shown)}" alt="{_text(caption)}"></a>'
        f"<figcaption>{_text(caption)}</figcaption></figure>"
    )


def _predictors(run):
    """R² of the quality predictors where several builders were measured."""
    rows = predictors.table(run)
    if not rows:
        return []
    heads = ["ray set", "trees", *predictors.PREDICTORS.values(), "SAH cost and EPO", "all three"]
    lines = "".join(
        f"<tr><td>{_text(label)}<td class=number>{trees}"
        + "".join("<td class=number>" + ("–" if pd.isna(r) else f"{r:.2f}") for r in explained)
        for label, trees, *explained in rows
    )
    return [
        "<h2>Predictors of time</h2><p>R² of time per ray against figures of the tree, all relative to the mean of "
        "scene and ray set, by least squares over the binary BVHs (structures bvh_* of one traversal).</p>",
        f'<div class="scroll"><table><thead><tr>{"".join(f"<th>{_text(h)}" for h in heads)}<tbody>{lines}</table></div>',
    ]


def _number(column, pattern, factor=1):
    return lambda case: None if pd.isna(getattr(case, column)) else pattern.format(getattr(case, column) * factor)


def _interval(factor):
    def show(case):
        if pd.isna(case.median_ns):
            return None
        middle = f"{case.median_ns * factor:,.4g}"
        if pd.isna(case.lo_ns) or pd.isna(case.hi_ns):
            return middle
        return f"{middle} [{case.lo_ns * factor:,.4g}, {case.hi_ns * factor:,.4g}]"

    return show


def _verdict(case):
    """Every class but `exact` that occurred."""
    if pd.isna(case.verified) or case.verified == 0:
        return None
    found = [f"{getattr(case, name):,.0f} {name}" for name in VERDICTS[1:] if getattr(case, name) > 0]
    return f"{case.verified:,.0f} rays: {', '.join(found) or 'all exact'}"


# Heading, whether it is a number, and the cell's text or None.
_FIRST = [("scene", False, lambda case: case.label), ("structure", False, lambda case: case.spec)]
_STATUS = ("status", False, lambda case: f"{case.status}: {case.note}" if case.note else case.status)
_BUILD_COLUMNS = [
    *_FIRST,
    ("threads", True, _number("threads", "{:.0f}")),
    ("ms", True, _interval(1e-6)),
    ("million primitives/s", True, _number("rate", "{:,.3g}", 1e-6)),
    ("depth", True, _number("depth", "{:,.0f}")),
    ("inner nodes", True, _number("inner_nodes", "{:,.0f}")),
    ("leaves", True, _number("leaf_nodes", "{:,.0f}")),
    ("references", True, _number("references", "{:,.0f}")),
    ("SAH cost", True, _number("sah_cost", "{:,.4g}")),
    ("EPO", True, _number("epo", "{:,.4g}")),
    ("leaf depth", True, _number("leaf_depth", "{:,.3g}")),
    ("P(primitive hit | bound hit)", True, _number("tightness", "{:.3f}")),
    ("nodes, MB", True, _number("node_bytes", "{:,.3f}", 1e-6)),
    ("copied primitives, MB", True, _number("prim_bytes", "{:,.3f}", 1e-6)),
    ("scene still needed", False, lambda case: {0: "no", 1: "yes"}.get(case.needs_geometry)),
    _STATUS,
]
_QUERY_COLUMNS = [
    *_FIRST,
    ("ray set", False, lambda case: case.rays_label),
    ("rays", True, _number("rays", "{:,.0f}")),
    ("timed", True, _number("timed_rays", "{:,.0f}")),
    ("threads", True, _number("threads", "{:.0f}")),
    ("ns per ray", True, _interval(1)),
    ("the anchor's on these rays", True, _number("anchor_ns", "{:,.4g}")),
    ("million rays/s", True, _number("rate", "{:,.3g}", 1e-6)),
    ("steps per ray", True, _number("steps", "{:,.2f}")),
    ("primitive tests per ray", True, _number("prims", "{:,.2f}")),
    ("claim", False, lambda case: case.claim),
    ("verdict", False, _verdict),
    _STATUS,
]


def _table(cases, columns):
    if cases.empty:
        return "<p>None.</p>"
    heads = "".join(f"<th{_class('number' if numeric else '')}>{_text(name)}" for name, numeric, _ in columns)
    rows = []
    for case in cases.itertuples():
        cells = []
        for _, numeric, show in columns:
            text = show(case)
            kinds = ["number"] * numeric + ["none"] * (not text)
            cells.append(f"<td{_class(' '.join(kinds))}>{_text(text) if text else '–'}")
        rows.append(f"<tr{_class('refused' if case.status == 'refused' else '')}>{''.join(cells)}")
    return f'<div class="scroll"><table><thead><tr>{heads}<tbody>{"".join(rows)}</table></div>'


def _class(name):
    return f' class="{name}"' if name else ""


def _text(value):
    return html.escape(str(value))
