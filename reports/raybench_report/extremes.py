"""Plots and the page of `raybench extremes`: a figure a suite, pure functions of extremes.csv and extremes.json."""

import html
import json
import re
import textwrap
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from . import page, style
from .results import RunError, read_info, read_table, write_atomically

WIDTH = 2 * style.COLUMN
BROKEN = "#b00020"
BOUND = "95 % bound at 0 of n"
COLOURS = [*style.COLOURS, "#000000", "#8B6F47"]
ORDER = ["exact", "double", "watertight", "robust=true", "fast", "robust=false"]  # from careful to careless
RATE_TOP = 1.6  # above 100 %, so that marks there are whole


@dataclass(frozen=True)
class Extremes:
    """What `raybench extremes --out DIR` wrote. NaN means not available."""

    directory: Path
    rows: pd.DataFrame
    info: dict

    @property
    def looks(self):
        """Colour and mark of each spec: the colour tells the arithmetic, the mark the structure."""
        arithmetics, structures = self.arithmetics, sorted(self.rows["structure"].unique())
        marks = {name: style.MARKS[i % len(style.MARKS)] for i, name in enumerate(structures)}
        return {
            row.spec: (arithmetics[_arithmetic(row)], marks[row.structure])
            for row in self.rows.drop_duplicates("spec").itertuples()
        }

    @property
    def arithmetics(self):
        """Colour of each arithmetic, in the order of lanes and legend."""
        present = {_arithmetic(row) for row in self.rows.drop_duplicates("spec").itertuples()}
        return {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(sorted(present, key=_rank))}

    @property
    def suites(self):
        """What extremes.json says of each suite that has rows."""
        present = set(self.rows["suite"])
        return [suite for suite in self.info["suites"] if suite["name"] in present]


def _arithmetic(row):
    """What decides about failures: the parameter `numerics` or `robust`, else the structure itself."""
    if found := re.search(r"\bnumerics=(\w+)", row.params):
        return found[1]
    found = re.search(r"\brobust=\w+", row.params)
    return f"{row.structure}, {found[0]}" if found else row.structure


def _rank(arithmetic):
    kind = arithmetic.rpartition(", ")[2]
    return (ORDER.index(kind) if kind in ORDER else len(ORDER), arithmetic)


def read(directory):
    """Reads DIR/extremes.csv and extremes.json. Throws RunError."""
    directory = Path(directory)
    info = read_info(directory / "extremes.json")
    rows = read_table(directory / "extremes.csv")
    if rows.empty:
        raise RunError(f"{directory / 'extremes.csv'}: no rows, so there is nothing to draw")
    known = {suite.get("name") for suite in info.get("suites", [])}
    if unknown := sorted(set(rows["suite"]) - known):
        raise RunError(f"{directory / 'extremes.json'}: says nothing of the suites {', '.join(unknown)}")
    return Extremes(directory, rows, info)


def draw_all(extremes):
    """Writes DIR/plots/SUITE.png and .svg. Returns [(suite's name, what it is)]."""
    folder = extremes.directory / "plots"
    folder.mkdir(exist_ok=True)
    drawn = []
    for suite in extremes.suites:
        figure = draw(extremes, suite)
        for suffix in ("png", "svg"):
            metadata = {"Date": None, "Creator": None} if suffix == "svg" else {"Software": None}
            write_atomically(
                folder / f"{suite['name']}.{suffix}", lambda path, f=figure, m=metadata: f.savefig(path, metadata=m)
            )
        plt.close(figure)
        drawn.append((suite["name"], suite["doc"]))
    return drawn


def draw(extremes, suite):
    """The figure of a suite: a row of panels for each variant; share of failures, error of t, time per ray."""
    rows = extremes.rows[extremes.rows["suite"] == suite["name"]]
    variants = list(rows["variant"].unique())
    looks, colours = extremes.looks, extremes.arithmetics
    panels = [("failure_rate", "share of answers that fail")]
    if rows["second_rate"].notna().any():
        panels.append(("second_rate", f"share: {suite['second']}"))
    panels += [("t_error_p99", "error of t (ulp), 99th percentile"), ("ns_per_ray", "ns per ray (rough)")]
    if suite["name"] == "coincident":  # what must stay bounded
        rows = rows.assign(bytes=(rows["node_bytes"] + rows["prim_bytes"]) / rows["triangles"])
        panels += [
            ("build_ms", "time to build (ms, rough)"),
            ("bytes", "memory of nodes and copied triangles (bytes per triangle)"),
            ("depth", "depth of the tree"),
        ]
    columns = 3 if len(panels) == 6 else len(panels)
    lines = [(variant, panels[i : i + columns]) for variant in variants for i in range(0, len(panels), columns)]

    notes = _notes(suite, rows)
    text = textwrap.fill(notes, 170)
    below = 0.09 * (text.count("\n") + 1) + 0.1
    structures = {row.structure: looks[row.spec][1] for row in rows.drop_duplicates("structure").itertuples()}
    name_width = 0.088 * len(suite["name"]) + 0.16
    doc = textwrap.wrap(suite["doc"], int((WIDTH - name_width) * 21))
    head = 0.13 + 0.11 * max(len(doc), 1)
    above = head + 0.03 + 0.118 * (2 + (len(structures) > 9))
    cell = WIDTH / columns
    titles = [[textwrap.wrap(label, int(cell * 18)) for _, label in quantities] for _, quantities in lines]
    highest = max(len(lines_of) for row in titles for lines_of in row)
    title = 0.12 + 0.115 * (highest + (1 if len(variants) > 1 else 0))
    x_title = textwrap.wrap(suite["axis_title"], int(cell * 16))
    height, foot = 1.6, 0.21 + 0.105 * len(x_title)
    total = above + len(lines) * (title + height + foot) + below
    figure = plt.figure(figsize=(WIDTH, total))
    figure.text(0.008, 1 - 0.07 / total, suite["name"], fontsize=9, weight="bold", va="top")
    figure.text(name_width / WIDTH, 1 - 0.09 / total, "\n".join(doc), fontsize=6.5, va="top", linespacing=1.1)
    figure.text(0.008, 0.04 / total, text, fontsize=5.8, color=style.GREY, va="bottom", linespacing=1.15)
    arithmetics = [Line2D([], [], color=colour, linewidth=1.5, label=name) for name, colour in colours.items()]
    marks = [style.mark(name, style.GREY, shape) for name, shape in structures.items()]
    for at, handles in enumerate([[*arithmetics, style.mark(BOUND, "#888888", "_", size=6)], marks]):
        figure.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(0.004, 1 - (head + 0.118 * at) / total),
            ncols=9,
            columnspacing=1.1,
            handletextpad=0.4,
            handlelength=1.4,
            borderaxespad=0,
            borderpad=0.1,
            labelspacing=0.25,
        )

    place = Places(suite["axis"], rows["magnitude"])
    bottoms = {column: _lowest(rows, column) for column in ("failure_rate", "second_rate")}
    for i, (variant, quantities) in enumerate(lines):
        top = total - above - i * (title + height + foot) - title
        here = rows[rows["variant"] == variant]
        if variant:
            figure.text(0.06 / WIDTH, (top + title - 0.05) / total, variant, weight="bold", va="top")
        for k, (column, _) in enumerate(quantities):
            axis = figure.add_axes(
                ((k * cell + 0.5) / WIDTH, (top - height) / total, (cell - 0.6) / WIDTH, height / total)
            )
            axis.set_title("\n".join(titles[i][k]), loc="left", pad=3, linespacing=1.1)
            _panel(axis, here, column, (colours, looks), place, bottoms.get(column))
            place.label(axis, cell - 0.6)
            axis.set_xlabel("\n".join(x_title), labelpad=2, linespacing=1.1)
    return figure


class Places:
    """Where magnitudes stand: linear, or logarithmic with a place for zero one step left of the smallest."""

    def __init__(self, axis, magnitudes):
        self.linear = axis == "linear"
        values = np.array(sorted(set(magnitudes)))
        positive = values[values > 0]
        self.has_zero = not self.linear and (values <= 0).any()
        if self.linear:
            self.gap, self.zero = 0, 0
        else:
            logs = np.log10(positive) if len(positive) else np.array([0.0])
            self.gap = max((logs[-1] - logs[0]) / 9, 0.15)
            self.zero = logs[0] - self.gap
        at = self(values)
        self.values, self.at = values, at
        self.step = np.diff(at).min() if len(at) > 1 else 1.0
        margin = max(0.04 * (at[-1] - at[0]), 0.35 * self.step)
        self.limits = at[0] - margin, at[-1] + margin

    def __call__(self, magnitudes):
        magnitudes = np.asarray(magnitudes, dtype=float)
        if self.linear:
            return magnitudes
        with np.errstate(divide="ignore"):
            return np.where(magnitudes > 0, np.log10(magnitudes), self.zero)

    def label(self, axis, inches):
        """Sets limits and as many ticks as an axis of this length has room for."""
        most = int(inches / 0.32)
        axis.set_xlim(*self.limits)
        if self.linear:
            axis.xaxis.set_major_locator(style.ticker.MaxNLocator(most, steps=[1, 2, 2.5, 3, 5, 6, 10]))
            return
        positive = [v for v in self.values if v > 0]
        low, high = np.log10(positive[0]), np.log10(positive[-1])
        if high - low <= 3.6:  # few decades: name the points themselves
            ticks = positive[:: -(-len(positive) // most)]
        else:
            first, last = int(np.ceil(low - 1e-9)), int(np.floor(high + 1e-9))
            every = next(step for step in (1, 2, 3, 5, 10, 15, 20, 30, 50, 1000) if (last - first) // step < most)
            ticks = [10.0**d for d in range(first, last + 1) if d % every == 0]
        places = [float(np.log10(t)) for t in ticks]
        names = [style.number(t) for t in ticks]
        if self.has_zero:
            close = [
                i for i, p in enumerate(places) if (p - self.zero) * inches < 0.24 * (self.limits[1] - self.limits[0])
            ]
            places = [self.zero, *(p for i, p in enumerate(places) if i not in close)]
            names = ["0", *(n for i, n in enumerate(names) if i not in close)]
        axis.set_xticks(places, names)


def _lowest(rows, column):
    """Where the scale of shares ends: below every share and every bound of the suite."""
    shares, bounds = rows[column], rows[column.replace("rate", "bound")]
    low = min([1e-2, *shares[shares > 0], *bounds[shares == 0]])
    return 10.0 ** (np.floor(np.log10(low)) - 0.1)


def _panel(axis, rows, column, look, place, bottom):
    rate = column in ("failure_rate", "second_rate")
    values = rows[column].to_numpy(dtype=float)
    measured = np.isfinite(values)
    positive = values[measured & (values > 0)]
    colours, looks = look
    lanes = {}
    if rate:
        # Zeros: a lane for each arithmetic below the scale.
        decades = np.log10(RATE_TOP / bottom)
        lane = decades * 0.055
        lanes = {colour: bottom * 10 ** -(lane * (i + 0.7)) for i, colour in enumerate(colours.values())}
        floor = bottom * 10 ** -(lane * (len(colours) + 0.4))
        axis.set_yscale("log")
        axis.set_ylim(floor, RATE_TOP)
        axis.axhspan(floor, bottom, color="#eef3ee", zorder=0, linewidth=0)
        ticks = [10.0**d for d in range(int(np.ceil(np.log10(bottom))), 1)]
        names = [_percent(t) for t in ticks]
        axis.set_yticks([*ticks, np.sqrt(floor * bottom)], [*names, "0 of n"])
        axis.yaxis.set_minor_locator(style.ticker.NullLocator())
    elif not measured.any():
        axis.text(0.5, 0.5, "not judged", transform=axis.transAxes, ha="center", color=style.GREY)
        axis.set_yticks([])
    elif column == "depth":
        axis.set_ylim(0, max(1.08 * values[measured].max(), 1))
        axis.yaxis.set_major_locator(style.ticker.MaxNLocator(5, integer=True))
    elif len(positive):
        style.scale([axis], positive, "y")
    _shade(axis, rows, place)

    structures = list(rows["structure"].unique())
    width = 0.5 * place.step if len(structures) > 1 else 0
    for spec, (colour, shape) in looks.items():
        one = rows[(rows["spec"] == spec) & rows[column].notna()].sort_values("magnitude")
        if one.empty:
            continue
        shift = width * ((structures.index(one["structure"].iloc[0]) + 0.5) / len(structures) - 0.5)
        x, y = place(one["magnitude"]) + shift, one[column].to_numpy(dtype=float)
        if rate:
            zero = y == 0
            y = np.where(zero, lanes[colour], y)
            limit = one[column.replace("rate", "bound")].to_numpy(dtype=float)
            axis.plot(x[zero], limit[zero], "_", color="#888888", markersize=3.2, markeredgewidth=0.6, zorder=2)
        elif (y <= 0).any() and axis.get_yscale() == "log":
            y = np.where(y > 0, y, np.nan)
        axis.plot(
            x,
            y,
            color=colour,
            marker=shape,
            markersize=2.6,
            markeredgewidth=0.5,
            linewidth=0.7,
            alpha=0.9,
            zorder=3,
            clip_on=False,
        )
        broken = (one["status"] == "broken").to_numpy() & rate
        axis.plot(x[broken], y[broken], "o", color=BROKEN, markersize=6.5, markerfacecolor="none", zorder=4)


def _shade(axis, rows, place):
    """Grey where claims need not hold, crossed out where the scene model refused the input."""
    for magnitude, here in rows.groupby("magnitude"):
        at = float(place(magnitude))
        i = int(np.searchsorted(place.at, at))
        left = (place.at[i - 1] + at) / 2 if i > 0 else place.limits[0]
        right = (place.at[i + 1] + at) / 2 if i + 1 < len(place.at) else place.limits[1]
        if (here["status"] == "refused").all():
            axis.axvspan(left, right, facecolor="white", edgecolor="#bbbbbb", hatch="xxxx", linewidth=0, zorder=1)
        elif not here["in_range"].any():
            axis.axvspan(left, right, facecolor="#e4e4e4", linewidth=0, zorder=0.5)


def _notes(suite, rows):
    rays = rows["rays"].dropna()
    parts = [f"Fails: {suite['failure']}."]
    parts.append(
        "0 of n: not one ray failed; the rate may still be as high as the grey dash (about 3/n, confidence 95 %)."
    )
    if suite["second"]:
        parts.append(f"Second measure: {suite['second']}.")
    parts.append(f"Claims must hold: {suite['range']}.")
    if len(rays):
        low, high = f"{rays.min():,.0f}", f"{rays.max():,.0f}"
        parts.append(f"n = {low if low == high else f'{low} to {high}'} rays a point.")
    if not rows["in_range"].all():
        parts.append("Grey: outside of that range.")
    if (rows["status"] == "refused").any():
        parts.append("Crossed: the scene model refuses the input at load.")
    if (rows["status"] == "broken").any():
        parts.append("Red ring: a claim is broken.")
    for note, specs in rows[rows["status"] == "skipped"].groupby("note")["spec"]:
        parts.append(f"Not measured: {', '.join(sorted(specs.unique()))} ({note}).")
    parts.append("Marks of one point stand a little apart.")
    return " ".join(parts)


def _percent(rate):
    return f"{100 * rate:g} %" if rate >= 1e-4 else f"{style.number(100 * rate)} %"


def write(extremes, drawn):
    """Writes DIR/extremes.html over `drawn`. Returns its path."""
    rows, text = extremes.rows, html.escape
    broken = rows[(rows["status"] == "broken") & (rows["in_range"] == 1)]
    parts = [
        "<!DOCTYPE html>",
        (
            f'<html lang="en"><meta charset="utf-8"><title>raybench extremes: {text(extremes.directory.resolve().name)}'
            f"</title><style>{page.STYLE} .wide img {{ width: 60em; max-width: 100% }}</style>"
        ),
        "<h1>raybench extremes</h1>",
        (
            f"<p>{len(rows)} points: {', '.join(f'{n} {status}' for status, n in rows['status'].value_counts().items())}. "
            "Each figure makes one thing worse from left to right. The left panel shows which share of the answers fails; "
            "what lies in the green band did not fail once, and the grey dash above it says how high the true rate may "
            "still be. A flat line in that band is what a robust structure shows. reports/EXTREMES.md explains each "
            "suite.</p>"
        ),
        f"<h2>Broken claims</h2>{_listed(broken, 'None inside of the suites&#8217; ranges.')}",
        '<h2>Suites</h2><div class="wide">',
    ]
    parts += [page.figure(f"plots/{name}.svg", f"plots/{name}.png", f"{name}: {doc}") for name, doc in drawn]
    parts.append("</div>")
    refused = rows[rows["status"] == "refused"].drop_duplicates(["suite", "variant", "magnitude"])
    parts += [f"<h2>Refused at load</h2>{_listed(refused, 'Nothing.', named=False)}"]
    parts += [
        "<h2>Machine and settings</h2>",
        f"<pre>{text(json.dumps(extremes.info, indent=2, ensure_ascii=False))}</pre>",
    ]
    path = extremes.directory / "extremes.html"
    write_atomically(path, lambda temporary: temporary.write_text("\n".join(parts) + "\n", encoding="utf-8"))
    return path


def _listed(rows, nothing, named=True):
    if rows.empty:
        return f"<p>{nothing}</p>"
    items = []
    for row in rows.itertuples():
        where = f"{row.suite} at {row.magnitude:g}{f', {row.variant}' if row.variant else ''}"
        items.append(f"<li>{html.escape(where + (f', {row.spec}' if named else '') + ': ' + row.note)}")
    return f"<ul>{''.join(items)}</ul>"
