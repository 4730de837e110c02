"""Pareto fronts of `raybench tradeoff`."""

import re

import numpy as np
import pandas as pd

from ..results import short_names
from ..trade.pareto import DOMINATED, FRONT, UNDECIDED
from . import vega
from .vega import Chart

PLACES = [FRONT, UNDECIDED, DOMINATED]
EXACT = "no error"  # a point whose error is zero has no place on a logarithmic axis
SEEN = ["measured", "none seen: at most (95 %)", EXACT]
SHAPES = ["circle", "triangle-left", "square"]


def charts(folder, at):
    """A chart for each pair of measures, a panel for each scene and ray set. `at`: the number of the section."""
    grouped = {}
    for front in folder.found:
        grouped.setdefault(front.name, []).append(front)
    return [_chart(name, fronts, at, folder) for name, fronts in grouped.items()]


def _chart(name, fronts, at, folder):
    x, y = fronts[0].x, fronts[0].y
    label = short_names(folder.rows["scene"].unique())
    rows = pd.concat([_rows(front, label) for front in fronts], ignore_index=True)
    log = _is_log(fronts[0]) and (rows["x"] > 0).any()
    x_axis = vega.number("x", f"{x.title} ({'log scale, ' if log else ''}left is better)", log)
    if x.percent:
        x_axis["axis"] = {"labelExpr": "format(datum.value, '~%')", "values": [10.0**d for d in range(-7, 1)]}
        x_axis["scale"] |= {"domain": [rows["x"].min() / 3, min(1.0, rows["x"].max() * 3)]}
    better = (
        "up is faster" if y.better == "high" else "down is less" if y.column == "memory_bytes" else "down is faster"
    )
    y_axis = vega.number("y", f"{y.title} (log scale, {better})")
    seen = [s for s in SEEN if s in set(rows["seen"])]
    colour = {"field": "place", "type": "nominal", "title": "place", "sort": PLACES, "scale": {"domain": PLACES}}
    shape = {  # explained by the notes
        "field": "seen", "type": "nominal", "legend": None,
        "scale": {"domain": seen, "range": [SHAPES[SEEN.index(s)] for s in seen]},
    }  # fmt: skip
    tooltip = vega.tooltip(
        ("point", "point"), ("panel", "where"), ("place", "place"), ("dominated_by", "dominated by"),
        ("x_true", x.title, ".3~g"), ("y", y.title, ".4~g"), ("y_lo", "from", ".4~g"), ("y_hi", "to", ".4~g"), ("command", "again by"),
    )  # fmt: skip
    layers = [
        {
            "transform": [{"filter": f"datum.place == '{FRONT}'"}],
            "mark": {"type": "line", "interpolate": "step-after", "opacity": 0.5, "strokeDash": [4, 3]},
            "encoding": {"x": x_axis, "y": y_axis, "order": {"field": "x", "type": "quantitative"}},
        },
        {"mark": {"type": "rule", "opacity": 0.45}, "encoding": {"x": x_axis, "y": y_axis | {"field": "y_lo"}, "y2": {"field": "y_hi"}, "color": colour}},
        {"mark": {"type": "rule", "opacity": 0.45}, "encoding": {"y": y_axis, "x": x_axis | {"field": "x_lo"}, "x2": {"field": "x_hi"}, "color": colour}},
        {"mark": {"type": "point"}, "encoding": {"x": x_axis, "y": y_axis, "color": colour, "shape": shape} | tooltip},
        *(
            {
                "transform": [{"filter": f"datum.named == '{side} {place}'"}],
                "mark": {"type": "text", "align": align, "dx": dx, "dy": dy, "limit": 190, "style": "note"},
                "encoding": {"x": x_axis, "y": y_axis, "text": {"field": "name"}},
            }
            for side, align, dx in (("right", "left", 6), ("left", "right", -6))
            for place, dy in (("above", -8), ("below", 9))
        ),
    ]  # fmt: skip
    notes = [
        "The dashed line joins the points that nothing dominates; what is undecided is dominated by values whose intervals meet or are not known."
    ]
    if (rows["seen"] == SEEN[1]).any():
        notes.append("Triangles: no wrong answer was seen; the true share lies left of them (95 %).")
    if (rows["seen"] == EXACT).any():
        notes.append(
            "Squares: equal to the reference; they stand left of the smallest error, where the axis has no zero."
        )
    return Chart(
        f"front_{at}_{''.join(c if c.isalnum() else '_' for c in name)}",
        fronts[0].title,
        "Dots: what each setting costs and how wrong it is; the front of those that nothing dominates is joined.",
        {"layer": layers},
        rows,
        ["panel", "point", "place", "dominated_by", "x_true", "y", "y_lo", "y_hi", "command"],
        facet="panel",
        height=260,
        resolve={"scale": {"x": "shared" if x.percent else "independent", "y": "independent"}},
        spans={"y": {"of": ["y_lo", "y_hi"], "factor": 1}},
        notes=notes,
    )


def _rows(front, label):
    """x and y as drawn, with intervals; `x_true`: as measured."""
    x, y = front.x.axis(front.rows), front.y.axis(front.rows)
    found = pd.DataFrame({
        "point": front.rows["point"], "place": front.rows["place"], "dominated_by": front.rows["dominated_by"],
        "command": front.rows["command"],
        "panel": label[front.scene] + (f", {front.ray_set} rays" if front.ray_set else ""),
    })  # fmt: skip
    for name, axis, factor in (("x", x, front.x.factor), ("y", y, front.y.factor)):
        found[name] = axis.value * factor
        for end in ("lo", "hi"):
            ends = getattr(axis, end)
            found[f"{name}_{end}"] = np.where(np.isfinite(ends), ends, axis.value) * factor
    found["x_true"] = found["x"]
    found["seen"] = SEEN[0]
    zero = found["x"] == 0
    if front.x.percent:  # nothing seen among so many: the bound
        found.loc[zero, "x"] = found.loc[zero, "x_hi"]
        found.loc[zero, "seen"] = SEEN[1]
    elif zero.any() and (found["x"] > 0).any() and _is_log(front):
        found.loc[zero, ["x", "x_lo", "x_hi"]] = found.loc[~zero, "x"].min() / 3
        found.loc[zero, "seen"] = EXACT
    found["x_lo"] = found["x_lo"].where(found["x_lo"] > 0, found["x"])
    return found.assign(
        named=_named(found, _is_log(front) and bool((found["x"] > 0).all()), front.y.better == "high"),
        name=found["point"].map(short),
    )


def _is_log(front):
    """Errors of t are within few ulp, but for those of vertices that moved."""
    return front.x.column != "t_error_p99" or front.name == "vertices"


def short(point):
    """The point's name without the names of its parameters: "bvh_wide watertight", "embree robust"."""
    name, values = re.fullmatch(r"([^(]*)(?:\((.*)\))?", point).groups()
    pairs = [pair.partition("=") for pair in (values or "").split(",") if pair]
    words = [
        key if value == "true" else f"{key} {value}" if value.replace(".", "").isdigit() else value
        for key, _, value in pairs
    ]
    return " ".join([name, *words])


def _named(rows, log, high):
    """Where the name of a point of the front stands beside its dot: on the side where nothing can be, left and above where
    up is better (`high`), else left and below; of dots at the left edge on the other side."""
    x = np.log(rows["x"]) if log else rows["x"]
    edge = x.min() + 0.25 * (x.max() - x.min()) if log else 0.25 * x.max()
    free, other = ("left above", "right below") if high else ("left below", "right above")
    return pd.Series(np.where(x <= edge, other, free), rows.index).where(rows["place"] == FRONT, "")
