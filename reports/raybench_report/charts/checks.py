"""How much slower or faster `raybench check` found each comparison."""

import numpy as np
import pandas as pd

from ..results import rays_label
from . import vega
from .vega import Chart

VERDICTS = ["pass", "fail", "inconclusive"]
WORST = 30  # comparisons with a row of their own


def table(comparisons):
    """The comparisons of check.json in their order, the worst first. slower, lo, hi, allowed: in percent; NaN where there
    were too few samples for a look."""
    rows = pd.DataFrame(comparisons).rename(columns={"scene": "label", "structure": "spec"})
    rows["rays_label"] = [rays_label(*row) for row in zip(rows["ray_set"], rows["order"], rows["query"], strict=True)]
    # the scene last, and only where there are several: a narrow chart cuts the end of a long name off
    scenes = " / " + rows["label"] if rows["label"].nunique() > 1 else ""
    threads = rows["threads"].map(lambda n: "" if n == 1 else f" / {n} threads")
    rows["shown"] = rows["spec"] + " / " + rows["rays_label"] + threads + scenes
    for name, column in (("slower", "log_ratio"), ("lo", "lo"), ("hi", "hi")):
        rows[name] = 100 * np.expm1(pd.to_numeric(rows[column]))
    return rows.assign(allowed=100 * rows["tolerance"]).replace([np.inf, -np.inf], np.nan)


def charts(rows, at):
    """The worst comparisons with their intervals, and all of them by structure where there are more. `at`: the number of
    the section."""
    known = rows[rows["slower"].notna()]
    if known.empty:
        return []
    columns = ["name", "label", "spec", "rays_label", "threads", "verdict", "slower", "lo", "hi", "allowed"]
    note = "The interval of 95 % is of the median over pairs; left is faster. Upright ticks: what is allowed."
    worst = known.head(WORST)
    first = Chart(
        f"check_worst_{at}",
        "The worst comparisons" if len(known) > len(worst) else "All comparisons",
        "Dots: how much slower the second program was, with intervals; what is allowed is marked.",
        _panel("shown", list(worst["shown"])),
        worst[[*columns, "shown"]],
        columns,
        facet=None,
        notes=[note],
    )
    if len(known) <= len(worst):
        return [first]
    order = list(known.groupby("spec")["slower"].median().sort_values(ascending=False).index)
    return [
        first,
        Chart(
            f"check_all_{at}",
            "All comparisons, by structure",
            "Dots: how much slower the second program was, one dot a ray set.",
            _panel("spec", order),
            known[columns],
            columns,
            notes=["One dot a ray set, and one for all of them together."],
        ),
    ]


def _panel(rows, order):
    """Intervals, one row for each value of the column `rows`."""
    y = vega.names(rows, order)
    panel = vega.intervals(
        "slower",
        "lo",
        "hi",
        "slower by, % (left is faster)",
        y,
        vega.series("verdict", "verdict", VERDICTS),
        vega.tooltip(
            ("spec", "structure"),
            ("label", "scene"),
            ("rays_label", "rays"),
            ("slower", "slower by, %", "+.2f"),
            ("lo", "from", "+.2f"),
            ("hi", "to", "+.2f"),
            ("allowed", "allowed", ".3~g"),
            ("verdict", "verdict"),
        ),
        log=False,
    )
    x = vega.number("allowed", "slower by, % (left is faster)", log=False)
    panel["layer"].insert(0, {"mark": "rule", "encoding": {"x": {"datum": 0, "type": "quantitative"}}})
    panel["layer"].append({"mark": {"type": "tick", "thickness": 2, "size": 12}, "encoding": y | {"x": x}})
    return panel
