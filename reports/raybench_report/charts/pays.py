"""Break-even: total time against number of rays, and from how many rays on a dearer build pays."""

import zlib

import numpy as np
import pandas as pd

from ..results import NULL
from . import vega
from .vega import Chart

RESAMPLES = 1000
FEWEST, MOST = 2, 10  # decades of rays that the chart may span


def totals(report):
    """Build time and comparable time per ray of each structure x scene x ray set x run, at the fewest threads.

    ns: time per ray as over the anchor's full set: where a part was timed, scaled by what the anchor needed for the same
    part.
    """
    queries, builds = report.timed_queries, report.timed_builds
    keys = ["run", "label", "spec"]
    queries = queries[(queries["structure"] != NULL) & (queries["order"] != "shuffled")]
    queries = queries[queries["threads"] == queries.groupby(keys)["threads"].transform("min")]
    builds = builds[builds["threads"] == builds.groupby(keys)["threads"].transform("min")]
    columns = [*keys, "build_id", "build_ns", "build_threads"]
    builds = builds.rename(columns={"case_id": "build_id", "median_ns": "build_ns", "threads": "build_threads"})[
        columns
    ]
    both = queries.merge(builds, on=keys)
    full = both[both["spec"] == both["anchor"]].drop_duplicates(["run", "label", "rays_label"])
    whole = dict(zip(zip(full["run"], full["label"], full["rays_label"], strict=True), full["median_ns"], strict=True))
    whole = [whole.get(key, np.nan) for key in zip(both["run"], both["label"], both["rays_label"], strict=True)]
    part = both["timed_rays"] < both["rays"]
    scale = (np.array(whole, dtype=float) / both["anchor_ns"]).where(part).fillna(1)
    return both.assign(scale=scale, ns=both["median_ns"] * scale)


def crossings(report):
    """One row each time that, with more rays, another structure becomes the fastest in total.

    `rays` with an interval of 95 % [lo, hi] by bootstrap over the samples of both builds and both queries (medians,
    resampled independently). hi is infinite where the slower build may never pay; lo is 0 where it may at once.
    """
    draws = Draws(report.sample_times)
    groups, rows = {}, []
    for row in report.totals.sort_values(["build_ns", "ns"], kind="stable").itertuples():
        groups.setdefault((row.run, row.label, row.rays_label), []).append(row)
    for (run, label, rays_label), here in groups.items():
        current = here[0]
        while better := [
            (gain(current, row), row) for row in here if row.ns < current.ns and row.build_ns >= current.build_ns
        ]:
            at, following = min(better, key=lambda pair: pair[0])
            low, high = draws.interval(current, following)
            rows.append({
                "run": run, "label": label, "rays_label": rays_label, "before": current.spec, "after": following.spec,
                "rays": at, "lo": low, "hi": high, "build_ns": following.build_ns, "ns": following.ns,
            })  # fmt: skip
            current = following
    columns = ["run", "label", "rays_label", "before", "after", "rays", "lo", "hi", "build_ns", "ns"]
    place = {label: at for at, label in enumerate(report.scenes)}
    sets = {label: at for at, label in enumerate(report.ray_sets)}
    runs = {name: at for at, name in enumerate(report.names)}
    rows.sort(key=lambda row: (place[row["label"]], runs[row["run"]], sets[row["rays_label"]], row["rays"]))
    return pd.DataFrame(rows, columns=columns)


def gain(one, other):
    """From how many rays on `other`, dearer to build and faster, is the faster in total."""
    return (other.build_ns - one.build_ns) / (one.ns - other.ns)


class Draws:
    """Bootstrap over the samples of builds and queries: medians of RESAMPLES resamplings of each case, seeded by its id."""

    def __init__(self, samples):
        self.samples, self.known = samples, {}

    def medians(self, run, case):
        """Medians of a case's resampled samples, ns; None where there are no samples."""
        if (run, case) not in self.known:
            times = self.samples.get((run, case))
            if times is not None:
                noise = np.random.default_rng(zlib.crc32(case.encode()))
                times = np.median(times[noise.integers(0, len(times), (RESAMPLES, len(times)))], axis=1)
            self.known[run, case] = times
        return self.known[run, case]

    def interval(self, one, other):
        """Interval of 95 % of gain(one, other)."""
        found = [self.medians(row.run, case) for row in (one, other) for case in (row.build_id, row.case_id)]
        if any(medians is None for medians in found):
            return np.nan, np.nan
        price = found[2] - found[0]
        saved = found[1] * one.scale - found[3] * other.scale
        with np.errstate(divide="ignore", invalid="ignore"):
            at = np.where(saved > 0, np.maximum(price, 0) / saved, np.where(price > 0, np.inf, 0.0))
        low, high = np.quantile(at, [0.025, 0.975], method="inverted_cdf")
        return float(low), float(high)


def charts(report):
    """Total time against the number of rays."""
    known = report.totals
    if known.empty or known["spec"].nunique() < 2:
        return []
    found = report.crossings
    lines = known[["run", "label", "rays_label", "spec", "build_ns", "ns"]].assign(kind="line")
    winners = set(found["before"]) | set(found["after"])
    winners |= set(known.sort_values(["build_ns", "ns"]).drop_duplicates(["run", "label", "rays_label"])["spec"])
    winners = [spec for spec in report.order if spec in winners][:8]
    lines["shown"] = lines["spec"].where(lines["spec"].isin(winners), "never the fastest")
    points = found.assign(kind="crossing", spec=found["after"], shown=found["after"])
    finite = points["rays"][points["rays"] > 0]
    last = min(MOST, max(7, int(np.ceil(np.log10(finite.max()))) + 1)) if len(finite) else 7
    rows = pd.concat([lines, points], ignore_index=True)
    rows["place"] = rows["label"] if len(report.runs) == 1 else rows["label"] + " · " + rows["run"]
    rows["lo_shown"] = rows["lo"].clip(lower=10.0**FEWEST)
    rows["hi_shown"] = rows["hi"].clip(upper=10.0**last)
    colour = {
        "field": "shown", "type": "nominal", "title": "fastest in total somewhere",
        "scale": {"domain": winners}, "sort": winners,
    }  # fmt: skip
    x = vega.number("rays", "rays traced after one build (log scale)")
    x["scale"] |= {"domain": [10.0**FEWEST, 10.0**last], "clamp": True, "padding": 0}
    y = vega.number("ms", "total, ms (log scale)")
    # Rows of lines become points along the axis; those of crossings are points already.
    curve = [
        {
            "calculate": f"datum.kind == 'line' ? sequence({FEWEST}, {last} + 0.01, 0.125) : [log(datum.rays) / LN10]",
            "as": "decade",
        },
        {"flatten": ["decade"]},
        {"calculate": "datum.kind == 'line' ? pow(10, datum.decade) : datum.rays", "as": "rays"},
        {"calculate": "(datum.build_ns + datum.rays * datum.ns) / 1e6", "as": "ms"},
    ]
    cross = [{"filter": "datum.kind == 'crossing' && datum.rays > 0"}]
    shown = vega.tooltip(
        ("before", "from"), ("after", "to"), ("rays", "rays", ",.3~s"), ("lo", "interval from", ",.3~s"),
        ("hi", "interval to", ",.3~s"), ("label", "scene"), ("rays_label", "rays"),
    )  # fmt: skip
    panel = {
        "transform": curve,
        "layer": [
            {
                "transform": [{"filter": "datum.shown == 'never the fastest'"}],
                "mark": {"type": "line", "style": "muted", "strokeWidth": 1, "clip": True},
                "encoding": {"x": x, "y": y, "detail": [{"field": "spec"}, {"field": "run"}]}
                | vega.tooltip(("spec", "structure"), ("rays", "rays", ",.3~s"), ("ms", "ms", ",.4~g")),
            },
            {
                "transform": [{"filter": "datum.kind == 'line' && datum.shown != 'never the fastest'"}],
                "mark": {"type": "line", "clip": True},
                "encoding": {"x": x, "y": y, "color": colour, "strokeDash": colour, "detail": {"field": "run"}}
                | vega.tooltip(("spec", "structure"), ("rays", "rays", ",.3~s"), ("ms", "ms", ",.4~g")),
            },
            {
                "transform": cross,
                "mark": {"type": "rule", "strokeWidth": 4, "opacity": 0.5, "clip": True},
                "encoding": {"x": x | {"field": "lo_shown"}, "x2": {"field": "hi_shown"}, "y": y},
            },
            {
                "transform": cross,
                "mark": {"type": "point", "clip": True},
                "encoding": {"x": x, "y": y} | shown,
            },
        ]
    }  # fmt: skip
    return [
        Chart(
            "break_even", "Total time: from how many rays a dearer build pays",
            "Lines: build and rays together, for each structure; dots: where another becomes the fastest.",
            panel, rows, ["run", "label", "rays_label", "kind", "spec", "build_ns", "ns", "before", "after", "rays", "lo", "hi"],
            facet="place", single="rays_label", height=260,
            notes=[
                "One thread builds and traces. Dots: from there on the next structure is the fastest in total; bars: "
                "intervals of 95 % (bootstrap over samples). Grey: never the fastest."
            ],
        )
    ]  # fmt: skip
