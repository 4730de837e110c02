"""Where answers begin to fail: a chart a suite of `raybench extremes`."""

import re

import numpy as np
import pandas as pd

from . import vega
from .vega import Chart

ORDER = ["exact", "double", "watertight", "robust=true", "fast", "robust=false"]  # from careful to careless
QUANTITIES = {
    "failure_rate": "share of answers that fail",
    "second_rate": None,  # named by the suite
    "t_error_p99": "error of t (ulp), 99th percentile",
    "ns_per_ray": "ns per ray (rough)",
    "build_ms": "time to build, ms (rough)",
    "bytes": "bytes per triangle",
    "depth": "depth of the tree",
}
ONLY_COINCIDENT = ("build_ms", "bytes", "depth")  # what must stay bounded there


def arithmetic(row):
    """What decides about failures: the parameter `numerics` or `robust`, else the structure itself."""
    if found := re.search(r"\bnumerics=(\w+)", row.params):
        return found[1]
    found = re.search(r"\brobust=\w+", row.params)
    return f"{row.structure}, {found[0]}" if found else row.structure


def rank(name):
    """Order of legend and lanes."""
    kind = name.rpartition(", ")[2]
    return (ORDER.index(kind) if kind in ORDER else len(ORDER), name)


def charts(folder):
    """A chart for each suite of the folder."""
    rows = folder.rows.assign(run=folder.shown)
    rows["bytes"] = (rows["node_bytes"] + rows["prim_bytes"]) / rows["triangles"]
    rows["arithmetic"] = [arithmetic(row) for row in rows[["params", "structure"]].itertuples()]
    kinds = sorted(rows["arithmetic"].unique(), key=rank)
    return [_suite(rows[rows["suite"] == suite["name"]], suite, kinds) for suite in folder.suites]


def _suite(rows, suite, kinds):
    columns = [
        "run", "suite", "variant", "magnitude", "in_range", "spec", "arithmetic", "status", "quantity", "value", "bound", "rays",
    ]  # fmt: skip
    parts = []
    for column, title in QUANTITIES.items():
        if column in ONLY_COINCIDENT and suite["name"] != "coincident":
            continue
        here = rows[rows[column].notna()]
        if here.empty:
            continue
        share = column.endswith("_rate")
        part = here.assign(quantity=title or suite["second"], value=here[column], share=share)
        part["bound"] = here[column.replace("rate", "bound")] if share else np.nan
        part["rays"] = here["second_rays" if column == "second_rate" else "rays"]
        parts.append(part)
    long = (
        pd.concat(parts, ignore_index=True)
        if parts
        else rows.assign(quantity="", value=np.nan, bound=np.nan, share=False)
    )
    # A share of zero is drawn at the bound that was shown, as a triangle: the true one lies below. Those of different
    # arithmetics would hide each other, so they stand a little apart, further down.
    zero = long["share"] & (long["value"] == 0)
    lane = long["arithmetic"].map(kinds.index)
    long["shown"] = long["value"].where(~zero, long["bound"] * 0.86**lane)
    long["seen"] = np.where(zero, "none failed: at most (95 %)", "measured")
    long["series"] = long["structure"] + ", " + long["arithmetic"]
    several = long["variant"].nunique() > 1
    long["panel"] = np.where(
        several & (long["variant"] != ""), long["variant"] + ": " + long["quantity"], long["quantity"]
    )
    # Zero has no place on a logarithmic axis: one step left of the smallest magnitude.
    positive = rows.loc[rows["magnitude"] > 0, "magnitude"]
    linear, zeros = suite["axis"] == "linear", bool((rows["magnitude"] <= 0).any())
    steps = np.unique(positive)
    left = steps[0] / (steps[1] / steps[0]) if len(steps) > 1 else (steps[0] / 10 if len(steps) else 1)
    long["at"] = long["magnitude"] if linear else long["magnitude"].where(long["magnitude"] > 0, left)
    x = vega.number("at", suite["axis_title"], log=not linear)
    if not linear:
        x["axis"]["labelExpr"] = (f"datum.value <= {left * 1.0001:.17g} ? '0' : " if zeros else "") + vega.DECADES
        if zeros:
            x["axis"]["values"] = [
                float(left),
                *(10.0**d for d in range(int(np.ceil(np.log10(steps[0]))), int(np.log10(steps[-1])) + 1)),
            ]
    y = vega.free(vega.number("shown", None))
    colour = {
        "field": "arithmetic",
        "type": "nominal",
        "title": "arithmetic",
        "sort": kinds,
        "scale": {"domain": kinds},
    }
    seen = ["measured", "none failed: at most (95 %)"]
    shown = vega.tooltip(
        ("spec", "structure"), ("magnitude", suite["axis_title"], "~g"), ("quantity", "quantity"), ("value", "value", ".4~g"),
        ("bound", "at most (95 %)", ".2~e"), ("rays", "rays", ","), ("status", "status"), ("note", "note"),
    )  # fmt: skip
    drawable = {"filter": "datum.shown > 0"}
    panel = {
        "transform": [drawable],
        "layer": [
            {
                "mark": {"type": "line", "strokeWidth": 1, "opacity": 0.6},
                "encoding": {"x": x, "y": y, "color": colour, "detail": [{"field": "spec"}]},
            },
            {
                "mark": {"type": "point", "size": 26},
                "encoding": {"x": x, "y": y, "color": colour, "shape": {
                    "field": "seen", "type": "nominal", "title": None, "sort": seen,
                    "scale": {"domain": seen, "range": ["circle", "triangle-down"]}},
                    "opacity": {"condition": {"test": "datum.in_range == 0", "value": 0.3}, "value": 0.95}} | shown,
            },
            {
                "transform": [{"filter": "datum.status == 'broken' && datum.share"}],
                "mark": {"type": "point", "filled": False, "size": 140, "strokeWidth": 2, "shape": "circle", "color": "#d5002a"},
                "encoding": {"x": x, "y": y} | shown,
            },
        ],
    }  # fmt: skip
    kept = [*columns, "structure", "note", "shown", "seen", "share", "panel", "at"]
    return Chart(
        f"extremes_{suite['name']}", suite["name"].replace("_", " "), suite["doc"], panel, long[kept], columns, facet="panel",
        height=170, most=64, notes=_notes(suite, rows), resolve={"scale": {"y": "independent"}, "axis": {"x": "independent"}},
        spans={} if linear or zeros else {"x": {"of": ["at"], "factor": 1}},
    )  # fmt: skip


def _notes(suite, rows):
    rays = rows["rays"].dropna()
    parts = [f"Fails: {suite['failure']}.", f"Claims must hold: {suite['range']}."]
    if suite["second"]:
        parts.append(f"Second measure: {suite['second']}.")
    parts.append(
        "Triangles: not one ray failed; the true share lies below them (95 %). Those of one point stand a little apart."
    )
    if len(rays):
        low, high = f"{rays.min():,.0f}", f"{rays.max():,.0f}"
        parts.append(f"{low if low == high else f'{low} to {high}'} rays a point.")
    if not rows["in_range"].all():
        parts.append("Pale: outside of that range.")
    if (rows["status"] == "refused").any():
        at = sorted(rows.loc[rows["status"] == "refused", "magnitude"].unique())
        parts.append(f"The scene model refuses the input at load: {', '.join(f'{a:g}' for a in at)}.")
    if (rows["status"] == "broken").any():
        parts.append("Red ring: a claim is broken.")
    for note, specs in rows[rows["status"] == "skipped"].groupby("note")["spec"]:
        parts.append(f"Not measured: {', '.join(sorted(specs.unique()))} ({note}).")
    return parts
