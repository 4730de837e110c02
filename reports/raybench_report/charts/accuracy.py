"""Error against speed."""

import numpy as np
import pandas as pd

from ..results import ERRORS, NULL
from . import vega
from .vega import Chart

QUERIES = {"closest": "closest hit", "any": "any hit"}


def rows(report):
    """One row a structure x scene x run x kind of query: its share of wrong answers and its time per ray, over all ray
    sets that every structure shown answered."""
    cases = report.timed_queries
    cases = cases[(cases["structure"] != NULL) & cases["errors"].notna() & (cases["order"] != "shuffled")]
    found = []
    for (run, label, query), here in cases.groupby(["run", "label", "query"], sort=False):
        here = here[here["threads"] == here["threads"].min()]
        sets = set(here["rays_label"])
        for spec, one in here.groupby("spec", sort=False):
            if set(one["rays_label"]) != sets:
                continue
            wrong, verified = one[ERRORS].sum().sum(), one["verified"].sum()
            found.append(
                {
                    "run": run,
                    "label": label,
                    "query": QUERIES.get(query, query),
                    "spec": spec,
                    "claim": one["claim"].iloc[0],
                    "wrong": wrong,
                    "verified": verified,
                    "share": wrong / verified,
                    # what 95 % of true rates are below, where none was seen
                    "shown": wrong / verified if wrong else 1 - 0.05 ** (1 / verified),
                    "seen": "measured" if wrong else "none seen: at most (95 %)",
                    "ns": np.average(one["median_ns"], weights=one["rays"]),
                }
            )
    return _with_places(pd.DataFrame(found)) if found else pd.DataFrame()


def _with_places(known):
    """`name`: where the structure's name stands, so that two do not stand on each other: left or right of its dot, and
    above or below where a neighbour's is near."""
    x, y = np.log(known["shown"]), np.log(known["ns"])
    left = x > x.min() + 0.6 * (x.max() - x.min())
    near = 0.09 * (y.max() - y.min())
    place = pd.Series("beside", known.index)
    named = (known["wrong"] > 0) & (known["run"] == known["run"].iloc[0])  # other runs' dots lie beside
    for _, here in known[named].groupby("label"):
        order = y[here.index].sort_values().index
        for below, above in zip(order, order[1:]):
            if y[above] - y[below] < near:
                place[above] = "above"
                place[below] = "below" if place[below] == "beside" else "beside"  # of three the middle one
    return known.assign(name=(np.where(left, "left ", "right ") + place).where(named, ""))


def charts(report):
    """Share of wrong answers against time per ray."""
    known = rows(report)
    if known.empty:
        return []
    seen = ["measured", "none seen: at most (95 %)"]
    x = vega.number("shown", "share of wrong answers (log scale, left is better)")
    x["axis"] = {"labelExpr": "format(datum.value, '~%')", "values": [10.0**d for d in range(-7, 1)]}
    x["scale"] = {
        "type": "log",
        "nice": False,
        "domain": [known["shown"].min() / 2, min(1.0, known["shown"].max() * 3)],
    }
    y = vega.number("ns", "ns per ray (log scale, down is faster)")
    panel = {
        "layer": [
            {
                "mark": {"type": "point"},
                "encoding": {"x": x, "y": y}
                | {
                    "color": {
                        "field": "query",
                        "type": "nominal",
                        "title": "query",
                        "scale": {"domain": list(QUERIES.values())},
                    },
                    "shape": {
                        "field": "seen",
                        "type": "nominal",
                        "title": "wrong answers",
                        "sort": seen,
                        "scale": {"domain": seen, "range": ["circle", "triangle-left"]},
                    },
                }
                | vega.tooltip(
                    ("spec", "structure"),
                    ("claim", "claims"),
                    ("query", "query"),
                    ("label", "scene"),
                    ("wrong", "wrong", ","),
                    ("verified", "verified rays", ","),
                    ("share", "share", ".3~%"),
                    ("shown", "shown", ".2~%"),
                    ("ns", "ns per ray", ",.4~g"),
                ),
            },
            *(
                {
                    "transform": [{"filter": f"datum.name == '{side} {place}'"}],
                    "mark": {"type": "text", "align": other, "dx": dx, "dy": dy, "limit": 150, "style": "note"},
                    "encoding": {"x": x, "y": y, "text": {"field": "spec"}},
                }
                for side, other, dx in (("right", "left", 7), ("left", "right", -7))
                for place, dy in (("above", -8), ("beside", 0), ("below", 8))
            ),
        ]
    }
    return [
        Chart(
            "error_and_speed",
            "Wrong answers against speed",
            "Dots: share of wrong answers and time per ray; down and left is better.",
            panel,
            known,
            ["run", "label", "query", "spec", "claim", "wrong", "verified", "share", "ns"],
            height=240,
            spans={"y": {"of": ["ns"], "factor": 1}},
            notes=[
                "Wrong: leak, wrong primitive, false miss or false hit, over all ray sets together; marginal ones do not count. "
                "Triangles: none was seen; the true share lies left of them (95 %)."
            ],
        )
    ]
