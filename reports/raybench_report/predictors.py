"""How well SAH cost, EPO and LCV predict measured time, over binary BVHs that differ only in their builder."""

import numpy as np

from . import style
from .results import timed

PREDICTORS = {"sah_cost": "SAH cost", "epo": "EPO", "lcv": "LCV"}
LEAST = 4  # trees of a scene, and R² of fewer points than this says nothing


def comparable(run):
    """Closest-hit cases of trees that one traversal walks, with time and predictors relative to their scene's mean.

    The structures named bvh_* that count in boxes, at their default arithmetic: nothing but the tree differs. Columns
    besides those of the run: `time` and one for each predictor, 1 being the mean of that scene and ray set.
    """
    cases = timed(run.queries)
    cases = cases[
        cases["structure"].str.startswith("bvh_")
        & ~cases["spec"].str.contains("numerics=", regex=False)
        & (cases["query"] == "closest")
        & (cases["order"] != "shuffled")
        & (cases["threads"] == cases["threads"].min())
        & cases[list(PREDICTORS)].notna().all(axis=1)
    ]
    groups = cases.groupby(["label", "rays_label"])
    cases = cases[groups["spec"].transform("size") >= LEAST]
    groups = cases.groupby(["label", "rays_label"])
    relative = {name: cases[name] / groups[name].transform("mean") for name in PREDICTORS}
    cases = cases.assign(time=cases["median_ns"] / groups["median_ns"].transform("mean"), **relative)
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


def table(run):
    """[(ray set, trees, R² of each predictor ..., of SAH and EPO, of all)], empty where there is too little."""
    cases = comparable(run)
    choices = [[name] for name in PREDICTORS] + [["sah_cost", "epo"], list(PREDICTORS)]
    rows = []
    for label in sorted(cases["rays_label"].unique()):
        here = cases[cases["rays_label"] == label]
        rows.append((label, len(here), *[explained(here, names) for names in choices]))
    return rows


def figure(run):
    """A panel per predictor: time against it, both relative to the scene's mean."""
    cases = comparable(run)
    if cases.empty:
        return None
    sets, scenes = sorted(cases["rays_label"].unique()), list(cases["label"].unique())
    drawing, axes = style.panels(len(PREDICTORS))
    for axis, (name, title) in zip(axes, PREDICTORS.items(), strict=True):
        known = []
        for i, label in enumerate(sets):
            here = cases[cases["rays_label"] == label]
            for j, scene in enumerate(scenes):
                one = here[here["label"] == scene]
                axis.plot(
                    one[name],
                    one["time"],
                    linestyle="none",
                    marker=style.MARKS[j % len(style.MARKS)],
                    color=style.COLOURS[i % len(style.COLOURS)],
                    markersize=2.5,
                    markeredgewidth=0,
                    alpha=0.7,
                )
            known.append(f"{label} {explained(here, [name]):.2f}")
        axis.set_title(f"{title}: R² {', '.join(known)}", loc="left", pad=3)
        axis.set_ylabel("time per ray")
    style.scale(axes, cases[list(PREDICTORS)].to_numpy())
    style.scale(axes, cases["time"], "y")
    marks = [style.mark(label, style.COLOURS[i % len(style.COLOURS)], "o") for i, label in enumerate(sets)]
    marks += [style.mark(s, style.GREY, style.MARKS[j % len(style.MARKS)]) for j, s in enumerate(scenes)]
    return style.finish(
        drawing,
        [1.4] * len(PREDICTORS),
        "predictor",
        style.legend(drawing, marks),
        [
            "Each mark is a tree by one builder; 1 is the mean of its scene and ray set.",
            f"{cases['spec'].nunique()} builders, {len(scenes)} scenes.",
        ],
    )
