"""Each case of a history over time, with the levels between its change points."""

import numpy as np
import pandas as pd

from ..results import rays_label
from . import vega
from .vega import Chart

MOST = 24  # cases drawn: those that changed most


def table(entries, cases):
    """One row a case and run of one machine. `entries`: of decide/history.py's store, the oldest first; `cases`: what
    decide/trend.py says of them. at: the number of the run, from 1; segment, level: between two changes."""
    rows = []
    for found in cases:
        scene, spec, ray_set, order, query, threads = found["case"]
        segments = np.searchsorted(found["changes"], np.arange(len(found["indices"])), side="right")
        rays = rays_label(ray_set, order, query)
        for k, index in enumerate(found["indices"]):
            entry = entries[index]
            rows.append({
                "case": f"{spec} · {rays} · {scene}" + (f" · {threads} threads" if threads != 1 else "") + ("" if found["is_ratio"] else ", ns"),
                "label": scene, "spec": spec, "rays_label": rays, "threads": threads, "at": int(index) + 1,
                "commit": entry["commit"][:12], "started": entry["started"], "unit": "ratio to the anchor" if found["is_ratio"] else "ns",
                "value": found["values"][k], "lo": found["lo"][k], "hi": found["hi"][k], "segment": int(segments[k]),
                "level": found["levels"][segments[k]], "jump": found["jump"],
            })  # fmt: skip
    return pd.DataFrame(rows)


def changes(entries, cases):
    """[(case's fields, change as a share, entry at which it begins)], the largest first."""
    found = [
        (row["case"], after / before - 1, entries[row["indices"][place]])
        for row in cases
        for place, before, after in zip(row["changes"], row["levels"], row["levels"][1:])
    ]
    return sorted(found, key=lambda change: -abs(np.log1p(change[1])))


def charts(rows, name):
    """A panel a case, those that changed most first."""
    kept = list(rows.drop_duplicates("case").sort_values("jump", ascending=False, kind="stable")["case"])[:MOST]
    x = {
        "field": "at", "type": "quantitative", "title": "run, the oldest first",
        "scale": {"zero": False, "nice": False, "padding": 8}, "axis": {"tickMinStep": 1, "format": "d", "tickCount": 6},
    }  # fmt: skip
    y = vega.number("value", None, log=False) | {"scale": {"zero": False, "nice": True}}
    y["axis"] = {"tickCount": 4, "labelExpr": vega.DECADES}
    panel = {
        "layer": [
            {
                "mark": {"type": "rule", "strokeWidth": 1.5, "opacity": 0.45},
                "encoding": {"x": x, "y": y | {"field": "lo"}, "y2": {"field": "hi"}},
            },
            {
                "mark": {"type": "line", "strokeWidth": 2},
                "encoding": {
                    "x": x,
                    "y": y | {"field": "level"},
                    "detail": {"field": "segment"},
                    "color": {"datum": "level", "type": "nominal", "legend": None, "scale": {"domain": ["run", "level"]}},
                },
            },
            {
                "mark": {"type": "point"},
                "encoding": {
                    "x": x,
                    "y": y,
                    "color": {"datum": "run", "type": "nominal", "legend": None, "scale": {"domain": ["run", "level"]}},
                }
                | vega.tooltip(
                    ("case", "case"), ("commit", "commit"), ("started", "started"), ("value", "value", ".4~g"),
                    ("lo", "from", ".4~g"), ("hi", "to", ".4~g"), ("level", "level", ".4~g"), ("unit", "in"),
                ),
            },
        ]
    }  # fmt: skip
    total = rows["case"].nunique()
    shown = f"The {len(kept)} of {total} cases that changed most. " if total > len(kept) else ""
    return [
        Chart(
            name,
            "Each case over time",
            "Dots: time of each run, one panel a case; lines: its level between changes.",
            panel,
            rows[rows["case"].isin(kept)],
            list(rows.columns),
            facet="case",
            height=110,
            most=MOST,
            resolve={"scale": {"y": "independent"}},
            notes=[
                shown + "Dots: medians with their intervals, as ratios to the anchor on the same rays where each run has one, else in ns; "
                "axes do not begin at zero. Lines: the level between two changes (PELT with absolute deviations, penalty of BIC)."
            ],
        )
    ]  # fmt: skip
