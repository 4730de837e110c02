"""How well SAH cost, EPO and LCV predict measured time, over binary BVHs that differ only in their builder."""

from itertools import combinations

import numpy as np
import pandas as pd

from . import vega
from .vega import Chart

PREDICTORS = {"sah_cost": "SAH cost", "epo": "EPO", "lcv": "LCV"}
LEAST = 4  # trees of a scene, and R² of fewer points than this says nothing


def is_binary(cases):
    """Which cases are of raybench's own binary BVHs of boxes."""
    return cases["structure"].str.startswith("bvh_") & ~cases["structure"].isin(["bvh_wide", "bvh_sphere"])


def comparable(report):
    """Closest-hit cases of trees that one traversal walks, with time and predictors relative to their scene's mean.

    Binary BVHs of boxes at their default arithmetic: nothing but the tree differs. Columns besides those of the run:
    `time` and one for each predictor, 1 being the mean of that run, scene and ray set.
    """
    cases = report.timed_queries
    cases = cases[
        is_binary(cases)
        & ~cases["spec"].str.contains("numerics=", regex=False)
        & (cases["query"] == "closest")
        & (cases["order"] != "shuffled")
        & (cases["threads"] == cases["threads"].min())
        & cases[list(PREDICTORS)].notna().all(axis=1)
    ]
    group = ["run", "label", "rays_label"]
    cases = cases[cases.groupby(group)["spec"].transform("size") >= LEAST]
    groups = cases.groupby(group)
    relative = {name: cases[name] / groups[name].transform("mean") for name in PREDICTORS}
    middle = groups["median_ns"].transform("mean")
    cases = cases.assign(
        time=cases["median_ns"] / middle, time_lo=cases["lo_ns"] / middle, time_hi=cases["hi_ns"] / middle, **relative
    )
    return cases[np.isfinite(cases[list(PREDICTORS)]).all(axis=1)]


def explained(cases, names):
    """R² of time by least squares over these predictors: the share of its variance within scenes that they explain."""
    if len(cases) < LEAST + len(names):
        return np.nan
    known = np.column_stack([np.ones(len(cases)), cases[list(names)]])
    time = cases["time"].to_numpy()
    solution = np.linalg.lstsq(known, time, rcond=None)[0]
    total = ((time - time.mean()) ** 2).sum()
    return 1 - ((time - known @ solution) ** 2).sum() / total if total > 0 else np.nan


def rank_correlation(cases, name):
    """Spearman's coefficient of time and predictor within each scene and ray set, averaged; NaN where a rank is constant."""
    found = []
    for _, here in cases.groupby(["run", "label", "rays_label"]):
        ranks = here[["time", name]].rank()
        if (ranks.std() > 0).all():
            found.append(ranks["time"].corr(ranks[name]))
    return float(np.mean(found)) if found else np.nan


def wrong_signs(cases, name):
    """(wrong, pairs): of the pairs of trees of one scene and ray set whose times are told apart by their intervals, how
    many the predictor puts in the other order. Equal predictions are no wrong sign."""
    wrong = pairs = 0
    for _, here in cases.groupby(["run", "label", "rays_label"]):
        for one, other in combinations(here.itertuples(), 2):
            if one.time > other.time:
                one, other = other, one
            if not one.time_hi < other.time_lo:  # intervals overlap, or there is none
                continue
            pairs += 1
            wrong += getattr(one, name) > getattr(other, name)
    return wrong, pairs


def table(report):
    """One row a ray set x choice of predictors: trees, r2; rank and wrong of pairs for single ones."""
    cases = comparable(report)
    choices = [[name] for name in PREDICTORS] + [["sah_cost", "epo"], list(PREDICTORS)]
    rows = []
    for label in [s for s in report.ray_sets if s in set(cases["rays_label"])]:
        here = cases[cases["rays_label"] == label]
        for names in choices:
            row = {
                "rays": label,
                "trees": len(here),
                "predictor": " + ".join(PREDICTORS[n] for n in names),
                "r2": explained(here, names),
                "rank": np.nan,
                "wrong": np.nan,
                "pairs": np.nan,
            }
            if len(names) == 1:
                wrong, pairs = wrong_signs(here, names[0])
                row |= {"rank": rank_correlation(here, names[0]), "wrong": wrong, "pairs": pairs}
            rows.append(row)
    return pd.DataFrame(rows, columns=["rays", "trees", "predictor", "r2", "rank", "wrong", "pairs"])


def charts(report):
    """Time against each predictor, both relative to the mean of scene and ray set."""
    cases = comparable(report)
    if cases.empty:
        return []
    keys = ["run", "label", "rays_label", "spec", "time"]
    rows = cases.melt(keys, list(PREDICTORS), "predictor", "prediction")
    rows["predictor"] = rows["predictor"].map(PREDICTORS)
    sets = [s for s in report.ray_sets if s in set(rows["rays_label"])]
    panel = {
        "mark": {"type": "point", "opacity": 0.75},
        "encoding": {
            "x": vega.number("prediction", "predictor, 1 = mean of scene and ray set", log=False)
            | {"scale": {"zero": False, "nice": True}},
            "y": vega.number("time", "time per ray, likewise", log=False) | {"scale": {"zero": False, "nice": True}},
        }
        | vega.series("rays_label", "rays", sets)
        | vega.tooltip(
            ("spec", "structure"),
            ("label", "scene"),
            ("rays_label", "rays"),
            ("prediction", "predictor", ".3f"),
            ("time", "time", ".3f"),
        ),
    }
    return [
        Chart(
            "predictor_dots",
            "Predictors of time",
            "Dots: time per ray against SAH cost, EPO and LCV, one dot a tree.",
            panel,
            rows,
            [*keys, "predictor", "prediction"],
            facet="predictor",
            height=200,
            resolve={"scale": {"x": "independent"}},
            notes=[f"Binary BVHs of {cases['spec'].nunique()} builders under one traversal, closest hits."],
        )
    ]
