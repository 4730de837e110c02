"""What all charts share: the form of a chart, its look in light, dark and print, and Vega-Lite's encodings.

A chart is defined once, as a Vega-Lite panel and the table it draws. The page draws it in the reader's width and theme
and with the reader's filters; figures.py draws the same definition for paper.
"""

import math
from dataclasses import dataclass, field

import pandas as pd

# Okabe and Ito's colours, safe for colour-blind readers; darker (lighter) where they would not stand out on white (black).
LIGHT = ["#0072B2", "#D55E00", "#008A66", "#B8578F", "#A87400", "#3D97CC", "#333333", "#8B6F47"]
DARK = ["#56B4E9", "#FF8A3D", "#2CC295", "#E79CC8", "#EDB53C", "#9BC7FF", "#DDDDDD", "#C4A57B"]
SHAPES = ["circle", "square", "triangle-up", "diamond", "cross", "triangle-down", "triangle-right"]
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif"


@dataclass
class Chart:
    """One chart: `panel` is a Vega-Lite unit or layer without data, drawn once for each value of `facet`.

    rows     the table it draws, or the name of rows that the page has anyway: "queries" or "builds"
    columns  those that its CSV has
    single   a column of which one value at a time is drawn; the reader's choice, else the first
    resolve  Vega-Lite's, where panels do not share their scales
    spans    what logarithmic axes show, for their ticks: {"x": {"of": columns, "factor": what they are multiplied by}}
    step     pixels a row, where y is a list of names
    most     panels drawn at once; the page's filters choose others
    """

    name: str
    title: str
    says: str
    panel: dict
    rows: pd.DataFrame | str
    columns: list
    facet: str | None = "label"
    single: str | None = None
    step: int = 20
    most: int = 6
    height: int | None = None
    notes: list = field(default_factory=list)
    resolve: dict = field(default_factory=dict)
    spans: dict = field(default_factory=dict)


def config(theme):
    """Vega's configuration for "light", "dark" or "print"."""
    dark, paper = theme == "dark", theme == "print"
    text, faint, grid = ("#e6e6e6", "#a8b0ba", "#333b45") if dark else ("#1c2126", "#5a636e", "#e3e6ea")
    size = 8 if paper else 12
    return {
        "font": "DejaVu Sans, sans-serif" if paper else FONT,
        "background": None if not paper else "white",
        "view": {"stroke": None},
        "range": {"category": DARK if dark else LIGHT, "symbol": SHAPES},
        "axis": {
            "labelColor": text, "titleColor": faint, "gridColor": grid, "domainColor": faint, "tickColor": faint,
            "labelFontSize": size, "titleFontSize": size, "titleFontWeight": "normal", "labelLimit": 110 if paper else 190,
            "tickSize": 3, "domainWidth": 0.7, "gridWidth": 0.7, "tickWidth": 0.7,
        },
        "axisX": {"labelFlush": True, "labelOverlap": "greedy"},
        "header": {
            "labelColor": text, "labelFontSize": size + 1, "labelFontWeight": "bold", "labelAnchor": "start",
            "labelLimit": 400, "title": None, "labelPadding": 4,
        },
        "legend": {
            "labelColor": text, "titleColor": faint, "labelFontSize": size, "titleFontSize": size,
            "titleFontWeight": "normal", "orient": "top", "direction": "horizontal", "labelLimit": 240,
            "symbolSize": 30 if paper else 70, "symbolBaseFillColor": text, "symbolBaseStrokeColor": text, "columns": 4, "symbolOpacity": 1, "titleOrient": "top",
        },
        "point": {"filled": True, "size": 18 if paper else 48, "opacity": 0.9, "color": text},
        "rule": {"color": faint},
        "text": {"color": text, "fontSize": size},
        "line": {"strokeWidth": 1 if paper else 1.8, "color": faint},
        "concat": {"spacing": 12 if paper else 24},
        "facet": {"spacing": 10 if paper else 24},
        "tick": {"color": text},
        "style": {"muted": {"stroke": faint, "opacity": 0.35}, "note": {"fill": faint, "fontSize": size}},
    }  # fmt: skip


def names(column="spec", order=None, runs=()):
    """y as a list of names, one row each; of several runs, one row a run within each."""
    y = {
        "field": column, "type": "nominal", "title": None, "sort": order or "ascending",
        "axis": {"grid": True, "ticks": False, "domain": False, "labelPadding": 6},
    }  # fmt: skip
    return {"y": y} | ({"yOffset": {"field": "run", "type": "nominal", "sort": list(runs)}} if len(runs) > 1 else {})


def rows_field(panel):
    """The column that names the rows of a panel whose y is a list of names."""
    return next(layer["encoding"]["y"]["field"] for layer in panel.get("layer", [panel]) if "y" in layer["encoding"])


def number(column, title, log=True, **more):
    """A quantity along an axis."""
    scale = {"type": "log", "nice": False, "padding": 12} if log else {"zero": True, "nice": True}
    axis = {"tickCount": 5} | ({"labelExpr": DECADES} if log else {})
    return {"field": column, "type": "quantitative", "title": title, "scale": scale, "axis": axis} | more


def free(axis):
    """The axis with ticks at 1, 2, 5 of every decade, of which Vega drops every second where they are too many: for
    panels of one chart that show different quantities."""
    values = [float(f"{m}e{d}") for d in range(-12, 13) for m in (1, 2, 5)]
    return axis | {"axis": axis["axis"] | {"values": values, "labelOverlap": "parity", "labelSeparation": 2}}


# 0.001 to 9999 in full; 20k, 3M; 1e-5.
DECADES = (
    "datum.value == 0 ? '0' : datum.value >= 10000 ? format(datum.value, '~s') : "
    "format(datum.value, datum.value >= 0.001 ? '~r' : '~e')"
)


def ticks(low, high, most):
    """At most `most` ticks of a logarithmic axis: 1, 2, 5 in each decade where it is short, else powers of ten. None:
    leave it to Vega, for the axis is shorter than half a decade."""
    if not 0 < low < high:
        return None
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    fine = [m * 10.0**d for d in range(first, last + 1) for m in (1, 2, 5) if low * 0.9 <= m * 10.0**d <= high * 1.1]
    if len(fine) < 2:
        return None
    if len(fine) <= most:
        return fine
    step = -(-(last - first + 1) // most)
    return [10.0**d for d in range(first, last + 1) if d % step == 0]


def series(column, title, values):
    """Colour and shape of a category: the same ones whatever is filtered."""
    scale = {"domain": list(values)}
    one = {"field": column, "type": "nominal", "title": title, "sort": list(values)}
    return {
        "color": one | {"scale": scale},
        "shape": one | {"scale": scale | {"range": [SHAPES[i % len(SHAPES)] for i in range(len(values))]}},
    }


def tooltip(*fields):
    """(column, title) or (column, title, format) each."""
    shown = []
    for column, title, *form in fields:
        shown.append(
            {"field": column, "title": title}
            | ({"type": "quantitative", "format": form[0]} if form else {"type": "nominal"})
        )
    return {"tooltip": shown}


def intervals(value, low, high, title, y, marks, shown, log=True):
    """Dots at `value` with lines from `low` to `high`."""
    return {
        "layer": [
            {
                "mark": {"type": "rule", "strokeWidth": 2, "opacity": 0.55},
                "encoding": y | {"x": number(low, title, log), "x2": {"field": high}, "color": marks["color"]},
            },
            {"mark": {"type": "point"}, "encoding": y | marks | shown | {"x": number(value, title, log)}},
        ]
    }
