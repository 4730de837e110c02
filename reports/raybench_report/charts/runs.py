"""Two runs side by side: how time changed, relative to each run's own anchor."""

import numpy as np
import pandas as pd

from ..results import NULL
from . import vega
from .vega import Chart

SAME = ["scene_hash", "structure", "params", "ray_hash", "query", "order", "threads"]


def ratios(report):
    """Cases that the first run and a later one both timed. ratio: later time / first time, each divided by its anchor's on
    the same rays, so that a slower machine does not count; lo, hi: from the ends of both cases' intervals."""
    if len(report.runs) < 2:
        return pd.DataFrame()
    cases = report.timed_queries
    cases = cases[(cases["structure"] != NULL) & (cases["spec"] != cases["anchor"])]
    relative = cases["anchor_ns"].where(cases["anchor_ns"].notna(), 1)
    cases = cases.assign(
        value=cases["median_ns"] / relative, low=cases["lo_ns"] / relative, high=cases["hi_ns"] / relative
    )
    kept = [*SAME, "anchor", "label", "spec", "rays_label", "ray_set", "value", "low", "high"]
    cases, rows = cases[["run", *kept]], []
    first = cases[cases["run"] == report.runs[0].shown]
    for run in report.runs[1:]:
        both = first.merge(cases.loc[cases["run"] == run.shown, kept], on=[*SAME, "anchor"], suffixes=("", "_later"))
        rows.append(
            both.assign(
                run=run.shown,
                first=report.runs[0].shown,
                ratio=both["value_later"] / both["value"],
                lo=both["low_later"] / both["high"],
                hi=both["high_later"] / both["low"],
            )
        )
    return pd.concat(rows, ignore_index=True).replace([np.inf], np.nan)


def charts(report):
    """Ratios of times, a panel a scene."""
    known = ratios(report)
    if known.empty:
        return []
    panel = vega.intervals(
        "ratio",
        "lo",
        "hi",
        f"time relative to {report.runs[0].shown} (log scale, left is faster)",
        vega.names(order=report.order, runs=report.names[1:]),
        vega.series("rays_label", "rays", report.ray_sets),
        vega.tooltip(
            ("spec", "structure"),
            ("rays_label", "rays"),
            ("run", "run"),
            ("ratio", "ratio", ".3f"),
            ("lo", "from", ".3f"),
            ("hi", "to", ".3f"),
        ),
    )
    panel["layer"].insert(
        0, {"mark": {"type": "rule", "strokeDash": [3, 3]}, "encoding": {"x": {"datum": 1, "type": "quantitative"}}}
    )
    columns = ["first", "run", "label", "spec", "rays_label", "query", "threads", "ratio", "lo", "hi"]
    return [
        Chart(
            "runs",
            "Runs side by side",
            "Dots: time in the later run relative to the first; left is faster.",
            panel,
            known[[*columns, "ray_set"]],
            columns,
            spans={"x": {"of": ["ratio", "lo", "hi"], "factor": 1}},
            notes=[
                "Each time is divided by its own run's anchor on the same rays, which takes out how fast the machine was; the "
                "lines combine the ends of both intervals. Runs were not interleaved: small differences prove nothing."
            ],
        )
    ]
