"""Break-even: total time against number of rays, and from how many rays on a dearer build pays."""

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
    builds = builds.rename(columns={"case_id": "build_id", "median_ns": "build_ns", "threads": "build_threads"})[columns]
    both = queries.merge(builds, on=keys)
    full = both[both["spec"] == both["anchor"]].drop_duplicates(["run", "label", "rays_label"])
    full = full.set_index(["run", "label", "rays_label"])["median_ns"]
    whole = [full.get(key, np.nan) for key in zip(both["run"], both["label"], both["rays_label"], strict=True)]
    scale = (np.array(whole, dtype=float) / both["anchor_ns"]).fillna(1)
    return both.assign(scale=scale, ns=both["median_ns"] * scale)


def crossings(report):
    """One row each time that, with more rays, another structure becomes the fastest in total.

    `rays` with an interval of 95 % [lo, hi] by bootstrap over the samples of both builds and both queries (medians,
    resampled independently). hi is infinite where the slower build may never pay; lo is 0 where it may at once.
    """
    samples = report.sample_times
    rows = []
    for (run, label, rays_label), here in totals(report).groupby(["run", "label", "rays_label"], sort=False):
        here = here.sort_values(["build_ns", "ns"])
        current = here.iloc[0]
        while True:
            better = here[(here["ns"] < current["ns"]) & (here["build_ns"] >= current["build_ns"])]
            if better.empty:
                break
            at = (better["build_ns"] - current["build_ns"]) / (current["ns"] - better["ns"])
            following = better.loc[at.idxmin()]
            low, high = interval(current, following, samples)
            rows.append({
                "run": run, "label": label, "rays_label": rays_label, "before": current["spec"], "after": following["spec"],
                "rays": max(float(at.min()), 0.0), "lo": low, "hi": high, "build_ns": following["build_ns"],
                "ns": following["ns"],
            })  # fmt: skip
            current = following
    columns = ["run", "label", "rays_label", "before", "after", "rays", "lo", "hi", "build_ns", "ns"]
    return pd.DataFrame(rows, columns=columns)


def interval(one, other, samples):
    """Bootstrap interval of 95 % of the number of rays from which `other` is faster in total."""
    draws = []
    for row in (one, other):
        noise = np.random.default_rng(17)  # equal draws for equal samples: no result depends on the order of rows
        for case, scale in ((row["build_id"], 1.0), (row["case_id"], row["scale"])):
            times = samples.get((row["run"], case))
            if times is None:
                return np.nan, np.nan
            picked = times[noise.integers(0, len(times), (RESAMPLES, len(times)))]
            draws.append(np.median(picked, axis=1) * scale)
    build_one, ray_one, build_other, ray_other = draws
    build_other, ray_other = np.roll(build_other, 311), np.roll(ray_other, 617)  # independent of the first's draws
    gain, price = ray_one - ray_other, build_other - build_one
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.where(gain > 0, np.maximum(price, 0) / gain, np.where(price > 0, np.inf, 0.0))
    low, high = np.quantile(at, [0.025, 0.975], method="inverted_cdf")
    return float(low), float(high)


def charts(report):
    """Total time against the number of rays."""
    known = totals(report)
    if known.empty or known["spec"].nunique() < 2:
        return []
    found = report.crossings
    lines = known[["run", "label", "rays_label", "spec", "build_ns", "ns"]].assign(kind="line")
    winners = set(found["before"]) | set(found["after"])
    for _, here in known.groupby(["run", "label", "rays_label"]):
        winners.add(here.sort_values(["build_ns", "ns"]).iloc[0]["spec"])
    winners = [spec for spec in report.order if spec in winners][:8]
    lines["shown"] = lines["spec"].where(lines["spec"].isin(winners), "never the fastest")
    points = found.assign(kind="crossing", spec=found["after"], shown=found["after"])
    finite = points["rays"][points["rays"] > 0]
    last = min(MOST, max(7, int(np.ceil(np.log10(finite.max()))) + 1)) if len(finite) else 7
    rows = pd.concat([lines, points], ignore_index=True)
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
        {"calculate": f"datum.kind == 'line' ? sequence({FEWEST}, {last} + 0.01, 0.125) : [log(datum.rays) / LN10]", "as": "decade"},
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
            single="rays_label", height=260,
            notes=[
                "One thread builds and traces. Dots: from there on the next structure is the fastest in total; bars: "
                "intervals of 95 % (bootstrap over samples). Grey: never the fastest."
            ],
        )
    ]  # fmt: skip
