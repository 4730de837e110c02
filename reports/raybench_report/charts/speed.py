"""Rays per second, time to build, memory, and what a ray costs in visits, tests and bytes."""

from ..results import NULL
from . import vega
from .vega import Chart

# One row a case, as tables and CSVs have them.
CASE = ["run", "scene", "spec", "ray_set", "query", "order", "threads", "status"]
TIMES = ["rays", "timed_rays", "samples", "median_ns", "lo_ns", "hi_ns", "rate", "anchor", "anchor_ns"]


def charts(report):
    """The charts of one row a case."""
    found = [chart for chart in (_rates(report), _builds(report), _memory(report), *_work(report)) if chart]
    if len(report.runs) > 1:
        for chart in found:
            chart.notes.append(f"Each structure has a row for each run, from the top: {', '.join(report.names)}.")
    return found


def _rates(report):
    cases = report.timed_queries
    if cases.empty:
        return None
    panel = vega.intervals(
        "mrays", "mrays_lo", "mrays_hi", "million rays per second (log scale, right is faster)",
        vega.names(order=report.order, runs=report.names),
        vega.series("rays_label", "rays", report.ray_sets),
        vega.tooltip(
            ("spec", "structure"), ("rays_label", "rays"), ("label", "scene"), ("run", "run"),
            ("mrays", "million rays/s", ".3~g"), ("median_ns", "ns per ray", ".3~f"), ("lo_ns", "from", ".3~f"),
            ("hi_ns", "to", ".3~f"), ("threads", "threads"), ("claim", "claims"),
        ),
    )  # fmt: skip
    panel["transform"] = [
        {"calculate": "datum.rate / 1e6", "as": "mrays"},
        {"calculate": "datum.hi_ns ? datum.rate / 1e6 * datum.median_ns / datum.hi_ns : null", "as": "mrays_lo"},
        {"calculate": "datum.lo_ns ? datum.rate / 1e6 * datum.median_ns / datum.lo_ns : null", "as": "mrays_hi"},
    ]
    notes = ["Dot: median over samples. Line: its interval of at least 95 %, where wider than the dot."]
    null = cases.loc[cases["structure"] == NULL, "median_ns"]
    if len(null):
        low, high = f"{null.min():.2g}", f"{null.max():.2g}"
        notes.append(f"Every time contains the harness's own {low if low == high else f'{low} to {high}'} ns per ray.")
    parts = cases[(cases["timed_rays"] < cases["rays"]) & (cases["structure"] != NULL)]
    if len(parts):
        notes.append(
            f"{len(parts)} of {(cases['structure'] != NULL).sum()} cases were timed on an evenly spread part of the rays "
            "(timed_rays); compare those by the ratio to the anchor, which traced the same part."
        )
    return Chart(
        "rays_per_second", "Rays per second", "Dots: rays per second of each structure, by kind of ray; right is faster.",
        panel, "queries", CASE + TIMES, notes=notes, spans={"x": {"of": ["rate"], "factor": 1e-6}},
    )  # fmt: skip


def _builds(report):
    cases = report.timed_builds
    if cases.empty:
        return None
    counts = sorted(cases["threads_label"].unique(), key=lambda label: int(label.split()[0]))
    panel = vega.intervals(
        "ms", "lo", "hi", "time to build, ms (log scale, left is faster)",
        vega.names(order=report.order, runs=report.names),
        vega.series("threads_label", "built by", counts),
        vega.tooltip(
            ("spec", "structure"), ("label", "scene"), ("run", "run"), ("threads", "threads"), ("ms", "ms", ".4~g"),
            ("lo", "from", ".4~g"), ("hi", "to", ".4~g"), ("samples", "samples"),
        ),
    )  # fmt: skip
    panel["transform"] = [
        {"calculate": f"datum.{column} ? datum.{column} / 1e6 : null", "as": name}
        for column, name in (("median_ns", "ms"), ("lo_ns", "lo"), ("hi_ns", "hi"))
    ]
    return Chart(
        "build_time", "Time to build", "Dots: time to build each structure, by number of threads; left is faster.",
        panel, "builds", [*CASE, "primitives", "samples", "median_ns", "lo_ns", "hi_ns", "rate"],
        notes=["From the common view of the geometry, fresh allocations and every conversion included."],
        spans={"x": {"of": ["median_ns", "lo_ns", "hi_ns"], "factor": 1e-6}},
    )  # fmt: skip


def _memory(report):
    cases = report.builds
    cases = cases[(cases["structure"] != NULL) & cases["node_bytes"].notna()]
    if cases.empty:
        return None
    parts = ["nodes", "copied primitives"]
    y = vega.names(order=report.order, runs=report.names)
    x = vega.number("bytes", "bytes per primitive", log=False)
    shown = vega.tooltip(
        ("spec", "structure"), ("label", "scene"), ("run", "run"), ("part", "part"), ("bytes", "bytes per primitive", ",.1f"),
        ("mb", "MB", ",.3~f"), ("scene_too", "also reads the scene"),
    )  # fmt: skip
    few = "datum.threads == datum.fewest"
    panel = {
        "transform": [
            {"joinaggregate": [{"op": "min", "field": "threads", "as": "fewest"}], "groupby": ["run", "label", "spec"]},
            {"filter": few},
            {"calculate": "datum.build_peak_bytes / datum.primitives", "as": "peak"},
            {"calculate": "datum.needs_geometry == 1 ? 'yes' : 'no'", "as": "scene_too"},
        ],
        "layer": [
            {
                "transform": [
                    {"fold": ["node_bytes", "prim_bytes"], "as": ["key", "all"]},
                    {"calculate": "datum.key == 'node_bytes' ? 'nodes' : 'copied primitives'", "as": "part"},
                    {"calculate": "datum.all / datum.primitives", "as": "bytes"},
                    {"calculate": "datum.all / 1e6", "as": "mb"},
                ],
                "mark": {"type": "bar", "height": {"band": 0.6}},
                "encoding": y | shown | {
                    "x": x,
                    "color": {"field": "part", "type": "nominal", "title": None, "scale": {"domain": parts}, "sort": parts},
                    "order": {"field": "part", "sort": "descending"},
                },
            },
            {
                "mark": {"type": "tick", "thickness": 2},
                "encoding": y | {"x": vega.number("peak", "bytes per primitive", log=False)}
                | vega.tooltip(("spec", "structure"), ("peak", "growth while building, bytes per primitive", ",.1f")),
            },
        ],
    }  # fmt: skip
    return Chart(
        "memory", "Memory", "Bars: bytes per primitive of nodes and of copied primitives; tick: growth while building.",
        panel, "builds",
        [*CASE, "primitives", "node_bytes", "prim_bytes", "needs_geometry", "build_peak_bytes"],
        notes=["Tick: growth of the process while building, which is measured and varies between runs."],
    )  # fmt: skip


WORK = [
    ("steps", "visits", "Nodes or cells visited per ray", "nodes or cells visited per ray"),
    ("prims", "tests", "Ray–primitive tests per ray", "ray–primitive tests per ray"),
    ("bytes", "bytes", "Bytes touched per ray", "bytes touched per ray"),
]


def _work(report):
    cases = report.queries
    cases = cases[(cases["structure"] != NULL) & cases["status"].isin(["timed"])]
    for column, name, title, axis in WORK:
        counted = cases[cases[column].notna() & (cases[column] > 0)]
        if counted.empty:
            continue
        silent = sorted(set(cases["spec"]) - set(counted["spec"]))
        panel = {
            "transform": [{"filter": f"isValid(datum.{column}) && datum.{column} > 0"}],
            "mark": {"type": "point"},
            "encoding": vega.names(order=[s for s in report.order if s in set(counted["spec"])], runs=report.names)
            | vega.series("rays_label", "rays", report.ray_sets)
            | {"x": vega.number(column, f"{axis} (log scale)")}
            | vega.tooltip(
                ("spec", "structure"), ("rays_label", "rays"), ("label", "scene"), ("run", "run"), (column, axis, ",.2~f"),
                ("lcv", "leaf count variability", ".3~f"),
            ),
        }  # fmt: skip
        notes = ["Counted over all rays of the set; does not depend on the machine."]
        if silent:
            notes.append(f"Not counted: {', '.join(silent)}.")
        yield Chart(
            name, title, f"Dots: {axis}, by structure and kind of ray; left is less work.", panel, "queries",
            [*CASE, "rays", "hits", "steps", "leaves", "empty_leaves", "bounds", "prims", "bytes", "lcv"], notes=notes,
            spans={"x": {"of": [column], "factor": 1}},
        )  # fmt: skip
