"""The fronts of a scene: which points compete on which pair of measures, and what each is worth."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from .. import columns
from .knobs import LEVELS
from .pareto import DOMINATED, FRONT, UNDECIDED, Axis, places

SHOWN = 10  # dominated points in a table of the terminal
RAYS = ("camera", "random", "diffuse", "aimed")


@dataclass(frozen=True)
class Measure:
    """A column of tradeoff.csv as an axis. `ends`: columns of its interval."""

    column: str
    title: str
    better: str = "low"
    ends: tuple = ()
    factor: float = 1.0  # of what is shown
    percent: bool = False

    def axis(self, rows):
        ends = [rows[c] for c in self.ends] or [None, None]
        return Axis.of(rows[self.column], *ends, better=self.better)


SPEED = Measure("speed", "million rays/s", "high", ("speed_lo", "speed_hi"))
WRONG = Measure("error_rate", "share of wrong answers", ends=("error_lo", "error_hi"), percent=True)
LEAKS = Measure("leak_rate", "share of leaks", ends=("leak_lo", "leak_hi"), percent=True)
T_ERROR = Measure("t_error_p99", "error of t, ulp (99 %)")
MEMORY = Measure("memory_bytes", "MB", factor=1e-6)
BUILD = Measure("build_ms", "build, ms", ends=("build_lo", "build_hi"))
SECONDS = Measure("seconds", "seconds a picture", ends=("seconds_lo", "seconds_hi"))
FLIP = Measure("flip_mean", "mean FLIP")
RMSE = Measure("rmse", "RMSE")
MEASURES = {m.column: m for m in (SPEED, WRONG, LEAKS, T_ERROR, MEMORY, BUILD, SECONDS, FLIP, RMSE)}


@dataclass
class Front:
    """One plot: `rows` of tradeoff.csv with `place` and `dominated_by` of each."""

    name: str
    title: str
    scene: str
    ray_set: str
    x: Measure
    y: Measure
    rows: pd.DataFrame

    def table(self):
        """Rows of fronts.csv."""
        found = pd.DataFrame({
            "scene": self.scene, "front": self.name, "knob": self.rows["knob"], "ray_set": self.ray_set,
            "point": self.rows["point"], "x": self.x.column, "y": self.y.column,
        })  # fmt: skip
        for side, measure in (("x", self.x), ("y", self.y)):
            axis = measure.axis(self.rows)
            found[f"{side}_value"] = axis.value
            for end in ("lo", "hi"):
                ends = getattr(axis, end)
                found[f"{side}_{end}"] = np.where(np.isfinite(ends), ends, np.nan)
        return found.assign(place=self.rows["place"].to_numpy(), dominated_by=self.rows["dominated_by"].to_numpy())


def fronts(rows):
    """All fronts of a tradeoff.csv. Points that were refused, skipped or disagree stand on none."""
    found = []
    for scene, here in rows.groupby("scene", sort=False):
        here = here[here["status"] == "measured"]
        for ray_set in [r for r in RAYS if r in set(here["ray_set"])]:
            found += _of_rays(scene, here[here["ray_set"] == ray_set], ray_set)
        found += _of_pictures(scene, here[here["ray_set"] == ""])
    return [front for front in found if len(front.rows) > 1]


def _of_rays(scene, here, ray_set):
    found = []
    if ray_set in ("aimed", "random"):
        scored, tests = here[here["knob"] == "numerics"], here[here["knob"] == "tests"]
        found.append(_front("wrong", "Wrong answers against speed", scene, ray_set, WRONG, SPEED, scored))
        found.append(_front("t_error", "Error of t against speed", scene, ray_set, T_ERROR, SPEED, scored))
        title = "Published tests, each called triangle by triangle: wrong answers against speed"
        found.append(_front("tests", title, scene, ray_set, WRONG, SPEED, tests))
    precision = here[here["knob"] == "precision"]
    if ray_set != "aimed":
        same = precision[precision["must_be_exact"] == 1]
        found.append(_front("precision", "Memory against speed", scene, ray_set, MEMORY, SPEED, same))
    if ray_set == "aimed":
        moved = precision[precision["must_be_exact"] == 0]
        title = "Quantised vertices: error of t against memory"
        found.append(_front("vertices", title, scene, ray_set, T_ERROR, MEMORY, moved))
        title = "Quantised vertices: leaks against memory"
        found.append(_front("vertices_leaks", title, scene, ray_set, LEAKS, MEMORY, moved))
    for knob in [k for k in here["knob"].unique() if "." in k]:
        own = here[here["knob"] == knob]
        if own["must_be_exact"].all():
            if ray_set != "aimed":
                found.append(
                    _front(f"{knob}:memory", f"{knob}: memory against speed", scene, ray_set, MEMORY, SPEED, own)
                )
                found.append(_front(f"{knob}:build", f"{knob}: build against speed", scene, ray_set, BUILD, SPEED, own))
        else:
            found.append(
                _front(f"{knob}:wrong", f"{knob}: wrong answers against speed", scene, ray_set, WRONG, SPEED, own)
            )
    return found


def _of_pictures(scene, here):
    error = FLIP if here["flip_mean"].notna().any() else RMSE
    of = lambda *knobs: here[here["knob"].isin(knobs)]
    return [
        _front("recursion", "Depth of recursion and cut-off", scene, "", error, SECONDS, of("depth", "contribution")),
        _front("samples", "Samples a pixel", scene, "", error, SECONDS, of("samples", "adaptive")),
        _front("filter", "Filters", scene, "", error, SECONDS, of("filter")),
        _front("lod", "Levels of detail: time", scene, "", error, SECONDS, of(*LEVELS)),
        _front("lod_memory", "Levels of detail: memory", scene, "", error, MEMORY, of(*LEVELS)),
        _front("shadows", "Shadow rays: any hit or the closest", scene, "", error, SECONDS, of("shadows")),
    ]


def _front(name, title, scene, ray_set, x, y, rows):
    rows = rows[rows[x.column].notna() & rows[y.column].notna()].reset_index(drop=True)
    rows = rows.drop_duplicates(["spec" if ray_set else "point"]).reset_index(drop=True)  # knobs may share a point
    if len(rows):
        place, by = places(x.axis(rows), y.axis(rows))
        rows = rows.assign(place=place, dominated_by=[rows["point"][k] if k >= 0 else "" for k in by])
    return Front(name, title, scene, ray_set, x, y, rows)


def table(found):
    """fronts.csv."""
    names = [name for name, *_ in columns.columns_of("fronts.csv")]
    return pd.concat([f.table() for f in found], ignore_index=True)[names] if found else pd.DataFrame(columns=names)


# ---- in sentences ----


def sentences(found, scenes=1):
    """What dominates what: a few plain sentences."""
    said = []
    for front in found:
        if front.name in ("wrong", "tests") or front.name.endswith(":wrong"):
            said.append(_of_arithmetic(front))
        elif front.name == "precision" and front.ray_set == "random":
            said.append(_of_memory(front))
        elif front.name == "shadows":
            said.append(_of_shadows(front))
        elif front.name in ("recursion", "samples", "filter", "lod"):
            said.append(_of_picture(front))
        elif front.name.endswith(":memory") and front.ray_set == "random":
            said.append(_of_parameter(front))
    return [f"{front_scene}: {text}" if scenes > 1 else text for front_scene, text in said]


def _of_arithmetic(front):
    rows = front.rows
    fastest = rows.loc[rows["speed"].idxmax()]
    among = {"wrong": "", "tests": ", of the published tests,"}.get(front.name, f", of `{rows['knob'].iloc[0]}`,")
    text = (
        f"On {front.ray_set} rays{among} `{fastest['point']}` is the fastest: {fastest['speed']:.3g} million rays/s, "
    )
    text += f"{share(fastest['error_rate'])} of the answers wrong." if fastest["error_rate"] else "no answer wrong."
    right = rows[rows["error_rate"] == 0]
    if fastest["error_rate"] and len(right):
        best = right.loc[right["speed"].idxmax()]
        text += (
            f" Without a wrong answer among {best['rays']:,.0f} the fastest is `{best['point']}`, at "
            f"{best['speed'] / fastest['speed']:.2f} of that speed."
        )
    elif not len(right):
        text += " Every point gives wrong answers."
    return front.scene, text + _dominated(front)


def _of_memory(front):
    rows = front.rows
    fastest, smallest = rows.loc[rows["speed"].idxmax()], rows.loc[rows["memory_bytes"].idxmin()]
    text = f"Of stored precision, on random rays, `{fastest['point']}` is the fastest ({fastest['memory_bytes'] / 1e6:.3g} MB)"
    if smallest["point"] != fastest["point"]:
        text += (
            f"; `{smallest['point']}` takes the least memory, {smallest['memory_bytes'] / fastest['memory_bytes']:.2f} of it, at "
            f"{smallest['speed'] / fastest['speed']:.2f} of its speed"
        )
    return front.scene, text + ", with the same answers to the bit." + _dominated(front)


def _of_parameter(front):
    rows = front.rows
    fastest, slowest = rows.loc[rows["speed"].idxmax()], rows.loc[rows["speed"].idxmin()]
    text = (
        f"`{rows['knob'].iloc[0]}`: `{fastest['point']}` is the fastest on random rays, "
        f"{fastest['speed'] / slowest['speed']:.2f} times as fast as `{slowest['point']}`; no answer moves."
    )
    return front.scene, text + _dominated(front)


def _of_shadows(front):
    rows = front.rows.sort_values("seconds")
    fast, slow = rows.iloc[0], rows.iloc[-1]
    text = (
        f"Shadow rays that ask for `{fast['point']}` take {fast['seconds'] / slow['seconds']:.2f} of the time of `{slow['point']}`, "
        "with the same picture to the bit."
    )
    return front.scene, text + _dominated(front)


NOT_SEEN = {"flip_mean": 0.01, "rmse": 0.004}  # errors that hardly anybody sees


def _of_picture(front):
    rows, column = front.rows, front.x.column
    best = rows.loc[rows[column].idxmin()]
    name = {"recursion": "depth and cut-off", "samples": "samples", "filter": "filters", "lod": "levels of detail"}[
        front.name
    ]
    text = f"Of {name}, `{best['point']}` is nearest to the reference ({front.x.title} {best[column]:.2g}) in {best['seconds']:.3g} s."
    good = rows[rows[column] <= NOT_SEEN[column]]
    if len(good):
        cheapest = good.loc[good["seconds"].idxmin()]
        if cheapest["point"] != best["point"]:
            text += (
                f" The cheapest below {NOT_SEEN[column]:g} is `{cheapest['point']}` ({cheapest[column]:.2g}), in "
                f"{cheapest['seconds'] / best['seconds']:.2f} of that time."
            )
    else:
        text += f" None is below {NOT_SEEN[column]:g}."
    return front.scene, text + _dominated(front)


def _dominated(front):
    """Which points beat how many others on both axes."""
    beaten = front.rows.loc[front.rows["place"] == DOMINATED, "dominated_by"].value_counts()
    open_ = int((front.rows["place"] == UNDECIDED).sum())
    if beaten.empty:
        text = " No point surely dominates another"
    else:
        by = [f"`{name}` dominates {count}" for name, count in beaten.head(2).items()]
        text = f" {' and '.join(by)} of the {len(front.rows) - 1} others"
    return text + (f"; {open_} undecided." if open_ else ".")


def share(value):
    """A share as text: 3.1 %, 0.0042 %."""
    return f"{100 * value:.2g} %"


def lines(front):
    """The front as a table for the terminal, the best on y first."""
    rows = front.rows.sort_values(front.y.column, ascending=front.y.better == "low")
    beaten = rows.index[rows["place"] == DOMINATED]
    rows, hidden = rows.drop(beaten[SHOWN:]), beaten[SHOWN:]
    mark = {FRONT: "front", UNDECIDED: "?", DOMINATED: "-"}
    table = [["", "point", front.y.title, "interval", front.x.title, "interval", "dominated by"]]
    for at, r in rows.iterrows():
        cells = [mark[r["place"]], r["point"]]
        for measure in (front.y, front.x):
            cells += [_figure(measure, r[measure.column]), _interval(measure, r)]
        table.append([*cells, r["dominated_by"]])
    widths = [max(len(row[i]) for row in table) for i in range(len(table[0]))]
    text = ["  " + "  ".join(cell.ljust(w) for cell, w in zip(row, widths)).rstrip() for row in table]
    return [*text, f"  and {len(hidden)} more that are dominated: fronts.csv"] if len(hidden) else text


def _figure(measure, value):
    if np.isnan(value):
        return "-"
    return share(value) if measure.percent else f"{value * measure.factor:.4g}"


def _interval(measure, row):
    if not measure.ends or any(np.isnan(row[c]) for c in measure.ends):
        return ""
    return " to ".join(_figure(measure, row[c]) for c in measure.ends)
