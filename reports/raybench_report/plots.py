"""The plots. Each function takes a Run and returns a figure, or None where the run has nothing for it."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Patch

from . import predictors, style
from .results import NULL, RunError, in_parallel, timed, write_atomically

INTERVAL = "Mark: median over samples; line: its interval of at least 95 %, where wider than the mark."


def draw_all(run):
    """Writes DIR/plots/NAME.png and NAME.svg. Returns [(name, what it shows)] in the order of the report."""
    jobs = []
    for count in sorted(timed(run.queries)["threads"].unique()):
        suffix = "" if not jobs else f"_threads{count:.0f}"
        jobs.append((f"rays_per_second{suffix}", f"Rays per second, {_threads(count)}", rays_per_second, count))
    jobs += [
        ("build_time", "Time to build", build_time),
        ("node_visits", "Nodes or cells traversed per ray", node_visits),
        ("primitive_tests", "Ray–primitive tests per ray", primitive_tests),
        ("memory", "Memory of the built structures", memory),
        ("error_and_speed", "Wrong answers against speed", error_and_speed),
        ("predictors", "What predicts the time of a tree: SAH cost, EPO, LCV", predictors.figure),
    ]
    (run.directory / "plots").mkdir(exist_ok=True)
    drawn = [entry for entry in in_parallel(_draw, [(run, *job) for job in jobs]) if entry]
    if not drawn:
        raise RunError(f"{run.directory / 'cases.csv'}: only {NULL} was timed, so there is nothing to draw")
    return drawn


def _draw(run, name, title, function, *arguments):
    """(name, title) if there was something to draw."""
    figure = function(run, *arguments)
    if figure is None:
        return None
    for suffix in ("png", "svg"):
        metadata = {"Date": None, "Creator": None} if suffix == "svg" else {"Software": None}
        path = run.directory / "plots" / f"{name}.{suffix}"
        write_atomically(path, lambda path: figure.savefig(path, metadata=metadata))
    plt.close(figure)
    return name, title


def rays_per_second(run, threads):
    """Rate of every ray set at one thread count, a panel per scene."""
    cases = run.queries[run.queries["threads"] == threads]
    chosen = timed(cases)
    chosen = chosen.assign(
        value=chosen["rate"] / 1e6,
        low=chosen["rate"] * chosen["median_ns"] / chosen["hi_ns"] / 1e6,
        high=chosen["rate"] * chosen["median_ns"] / chosen["lo_ns"] / 1e6,
    )
    return _ray_set_panels(
        run,
        chosen,
        f"million rays per second, {_threads(threads)}",
        [INTERVAL, _timed_parts(chosen), _harness_cost(chosen), _without_time(cases)],
    )


def node_visits(run):
    """Mean number of nodes or cells that a ray traverses (N_TS)."""
    chosen = timed(run.queries)
    return _ray_set_panels(run, chosen.assign(value=chosen["steps"]), "nodes or cells traversed per ray", [])


def primitive_tests(run):
    """Mean number of ray-primitive tests per ray (N_IT)."""
    chosen = timed(run.queries)
    return _ray_set_panels(run, chosen.assign(value=chosen["prims"]), "ray–primitive tests per ray", [])


def build_time(run):
    """Time to build by structure and threads, a panel per scene."""
    cases = timed(run.builds)
    cases = cases[cases["structure"] != NULL]
    scenes = [scene for scene in run.scenes if scene in set(cases["label"])]
    if not scenes:
        return None
    looks, counts = style.looks(run.specs), sorted(cases["threads"].unique())
    present = [[spec for spec in run.specs if spec in set(cases.loc[cases["label"] == s, "spec"])] for s in scenes]
    figure, axes = style.panels(len(scenes))
    for axis, scene, specs in zip(axes, scenes, present, strict=True):
        here = cases[cases["label"] == scene]
        for row, spec in enumerate(specs):
            for i, threads in enumerate(counts):
                one = here[(here["spec"] == spec) & (here["threads"] == threads)]
                place = row + 0.4 * ((i + 0.5) / len(counts) - 0.5)
                _points(
                    axis,
                    one["median_ns"] / 1e6,
                    one["lo_ns"] / 1e6,
                    one["hi_ns"] / 1e6,
                    place,
                    looks[spec][0],
                    style.MARKS[i % len(style.MARKS)],
                    hollow=i == 0 and len(counts) > 1,
                )
        _name_rows(axis, [style.wrap_spec(spec, 26) for spec in specs])
        _title(axis, here)
    style.scale(axes, cases[["median_ns", "lo_ns", "hi_ns"]] / 1e6)
    marks = [
        style.mark(_threads(c), style.GREY, style.MARKS[i % len(style.MARKS)], i == 0) for i, c in enumerate(counts)
    ]
    several = len(counts) > 1
    return style.finish(
        figure,
        [_rows_height(specs, 0.19) for specs in present],
        "time to build, ms" if several else f"time to build, ms, {_threads(counts[0])}",
        style.legend(figure, marks) if several else None,
        [INTERVAL, _without_time(run.builds)],
    )


def memory(run):
    """Bytes per primitive that each built structure keeps, and what its building took."""
    cases = run.cases[(run.cases["structure"] != NULL) & run.cases["status"].isin(["timed", "refused"])]
    columns = ["node_bytes", "prim_bytes", "needs_geometry", "build_peak_bytes", "primitives"]
    table = cases.groupby(["label", "spec"])[columns].max().reset_index()
    scenes = [scene for scene in run.scenes if scene in set(table["label"])]
    if not scenes or table["node_bytes"].isna().all():
        return None
    looks = style.looks(run.specs)
    present = [table[table["label"] == scene].sort_values("spec") for scene in scenes]
    figure, axes = style.panels(len(scenes))
    for axis, scene, here in zip(axes, scenes, present, strict=True):
        furthest = 1.0
        for row, case in enumerate(here.itertuples()):
            colour = looks[case.spec][0]
            if np.isnan(case.node_bytes):
                axis.text(0, row, " not counted", va="center", fontsize=6, color=style.GREY)
                continue
            copied = 0 if np.isnan(case.prim_bytes) else case.prim_bytes
            nodes, prims, peak = (x / case.primitives for x in (case.node_bytes, copied, case.build_peak_bytes))
            axis.barh(row, nodes, height=0.62, color=colour, linewidth=0)
            if prims > 0:
                axis.barh(
                    row,
                    prims,
                    height=0.62,
                    left=nodes,
                    facecolor="white",
                    edgecolor=colour,
                    hatch="/////",
                    linewidth=0.5,
                )
            axis.plot([peak], [row], marker="|", markersize=6, color="black", linestyle="none", zorder=3)
            end = np.nanmax([nodes + prims, peak])
            text = f"{_bytes(case.node_bytes + copied)}{' + scene' if case.needs_geometry == 1 else ''}"
            axis.annotate(text, (end, row), xytext=(3, 0), textcoords="offset points", va="center", fontsize=6)
            furthest = max(furthest, end)
        axis.set_xlim(0, 1.75 * furthest)
        axis.xaxis.set_major_locator(style.ticker.MaxNLocator(5, steps=[1, 2, 5, 10]))
        _name_rows(axis, [style.wrap_spec(spec, 26) for spec in here["spec"]])
        _title(axis, cases[cases["label"] == scene])
    notes = ["Numbers: nodes and copied primitives together."]
    if (table["needs_geometry"] == 1).any():
        notes.append("“+ scene”: queries still read the scene's own arrays, which are not included.")
    handles = [
        Patch(facecolor=style.GREY, label="nodes"),
        Patch(facecolor="white", edgecolor=style.GREY, hatch="/////", label="copied primitives"),
    ]
    if table["build_peak_bytes"].notna().any():
        handles.append(style.mark("growth while building", "black", "|", size=6))
        notes.append("Growth of the process while building is measured and varies between runs.")
    return style.finish(
        figure,
        [_rows_height(here, 0.19) for here in present],
        "bytes per primitive",
        style.legend(figure, handles),
        notes,
    )


def error_and_speed(run):
    """Share of wrong answers against time per ray: together and for each ray set, a panel per scene."""
    cases = timed(run.queries)
    cases = cases[(cases["structure"] != NULL) & cases["errors"].notna()]
    if cases.empty:
        return None
    threads = cases["threads"].min()
    cases = cases[cases["threads"] == threads]
    scenes = [scene for scene in run.scenes if scene in set(cases["label"])]
    looks = style.looks(run.specs)
    figure, axes = style.panels(len(scenes))
    for axis, scene in zip(axes, scenes, strict=True):
        here = cases[cases["label"] == scene]
        axis.axvline(0, color="#dddddd", linewidth=0.5, zorder=0)
        for spec in run.specs:
            one = here[here["spec"] == spec]
            _points(axis, one["errors"], None, None, one["median_ns"], *looks[spec], size=1.8, alpha=0.45)
            for query in ("closest", "any"):
                part = one[one["query"] == query]
                if len(part) and set(part["rays_label"]) == set(here.loc[here["query"] == query, "rays_label"]):
                    share = (part["errors"] * part["verified"]).sum() / part["verified"].sum()
                    ns = (part["median_ns"] * part["rays"]).sum() / part["rays"].sum()
                    _points(axis, [share], None, None, [ns], *looks[spec], hollow=query == "any", size=4.5)
            worst = one.sort_values("errors").tail(1)
            for case in worst[worst["errors"] > 0].itertuples():
                axis.annotate(
                    style.shorten(case.rays_label, 27),
                    (case.errors, case.median_ns),
                    xytext=(2, 3),
                    textcoords="offset points",
                    ha="right",
                    fontsize=5.5,
                    color=looks[spec][0],
                )
        axis.set_ylabel("ns per ray")
        _title(axis, here)
    if (cases["errors"] > 0).any():
        style.scale(axes, [0, *cases["errors"]])
    else:
        for axis in axes:
            axis.set_xlim(-0.05, 1)
            axis.set_xticks([0])
    style.scale(axes, cases["median_ns"], "y")
    few, many = cases["verified"].min(), cases["verified"].max()
    marks = [style.mark(spec, *looks[spec]) for spec in run.specs if spec in set(cases["spec"])]
    return style.finish(
        figure,
        [1.4] * len(scenes),
        f"share of wrong answers, {_threads(threads)}",
        style.legend(figure, marks),
        [
            "Down and left is better. Large marks: all ray sets together, filled for closest-hit and hollow for any-hit "
            "queries. Small ones: single ray sets, the worst of each structure named.",
            "Wrong: leak, wrong primitive, false miss or false hit; marginal ones are not counted.",
            f"Shares of {few:,.0f}{f' to {many:,.0f}' if many > few else ''} verified rays each; 0: none among these.",
            _timed_parts(cases),
        ],
    )


def _ray_set_panels(run, cases, label, notes):
    """Panel per scene: a row per ray set, a mark per structure at `value`, a line from `low` to `high`."""
    cases = cases[cases["structure"] != NULL]
    if cases.empty or cases["value"].isna().all():
        return None
    counted = cases[cases["value"].notna()]
    scenes = [scene for scene in run.scenes if scene in set(counted["label"])]
    looks = style.looks(run.specs)
    drawn = [spec for spec in run.specs if spec in set(cases["spec"])]
    present = [_ray_sets(counted[counted["label"] == scene]) for scene in scenes]
    figure, axes = style.panels(len(scenes))
    for axis, scene, sets in zip(axes, scenes, present, strict=True):
        here = counted[counted["label"] == scene]
        for i, spec in enumerate(drawn):
            one = here[here["spec"] == spec]
            places = one["rays_label"].map(sets.index) + 0.72 * ((i + 0.5) / len(drawn) - 0.5)
            _points(axis, one["value"], one.get("low"), one.get("high"), places, *looks[spec])
        _name_rows(axis, [style.shorten(name, 27) for name in sets])
        _title(axis, here)
    style.scale(axes, counted[[c for c in ("value", "low", "high") if c in counted]])
    with_value = set(counted["spec"])
    marks = []
    for spec in drawn:
        colour, shape = looks[spec]
        if spec in with_value:
            marks.append(style.mark(spec, colour, shape))
        else:
            marks.append(style.mark(f"{spec}: not counted", "#aaaaaa", shape, hollow=True))
    step = max(0.18, 0.05 * len(drawn) + 0.06)
    return style.finish(
        figure, [_rows_height(sets, step) for sets in present], label, style.legend(figure, marks), notes
    )


def _points(axis, x, low, high, y, colour, shape, hollow=False, size=3.0, alpha=1.0):
    """Marks at (x, y) with horizontal lines from low to high."""
    y = np.broadcast_to(y, len(x))
    if low is not None:
        axis.hlines(y, low, high, color=colour, linewidth=0.8)
    axis.plot(
        x,
        y,
        marker=shape,
        color=colour,
        markersize=size,
        markerfacecolor="none" if hollow else colour,
        markeredgewidth=0.7 if alpha == 1 else 0,
        linestyle="none",
        alpha=alpha,
        clip_on=False,
        zorder=3,
    )


def _name_rows(axis, names):
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.tick_params(axis="y", length=0)
    for boundary in range(1, len(names)):
        axis.axhline(boundary - 0.5, color="#dddddd", linewidth=0.4, zorder=0)


def _rows_height(rows, step):
    return max(0.35, step * len(rows))


def _title(axis, cases):
    primitives = cases["primitives"].max()
    count = "" if np.isnan(primitives) else f" ({primitives:,.0f} primitives)".replace(",", "\u2009")
    axis.set_title(f"{style.wrap_spec(cases['label'].iloc[0], 50)}{count}", loc="left", pad=3)


def _ray_sets(cases):
    """Ray sets of some cases: those the tracer recorded first, by kind and depth."""
    kinds = ["camera", "shadow", "reflection", "refraction"]
    first = cases.drop_duplicates("rays_label")

    def key(row):
        kind, _, depth = row.ray_set.partition(".")
        place = kinds.index(kind) if kind in kinds else len(kinds)
        return place, kind, depth.zfill(4), row.order, row.query

    return [row.rays_label for row in sorted(first.itertuples(), key=key)]


def _threads(count):
    return "1 thread" if count == 1 else f"{count:.0f} threads"


def _bytes(count):
    for unit in ("B", "KB", "MB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} GB"


def _timed_parts(cases):
    """Says which structures were timed on a part of the rays; their neighbours then traced others."""
    parts = cases[(cases["timed_rays"] < cases["rays"]) & (cases["structure"] != NULL)]
    if parts.empty:
        return ""
    least = (parts["rays"] / parts["timed_rays"]).groupby(parts["spec"]).max()
    shares = "; ".join(f"{spec} (down to 1/{share:.0f})" for spec, share in least.items())
    return f"Timed on an evenly spread part of the rays, where all would take too long: {shares}."


def _harness_cost(cases):
    """What `null` says: the harness's own cost, which every other time contains."""
    cost = cases.loc[cases["structure"] == NULL, "median_ns"]
    if cost.empty:
        return ""
    low, high = f"{cost.min():.2g}", f"{cost.max():.2g}"
    cost = low if low == high else f"{low} to {high}"
    return f"Every time contains the harness's own {cost} ns per ray (structure {NULL})."


def _without_time(cases):
    """Names the cases that were not timed, and why."""
    absent = cases[(cases["status"] != "timed") & (cases["structure"] != NULL)]
    if absent.empty:
        return ""
    groups = absent.groupby(["status", "spec", "label"], sort=True).size()
    parts = [f"{spec} on {scene} ({status})" for status, spec, scene in groups.index]
    return f"Not timed: {'; '.join(parts)}."
