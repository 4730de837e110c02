"""Folders of `raybench run`."""

import pandas as pd

from .. import answer, explain, pictures, results
from ..charts import accuracy, overlap, pays, predictors, runs, scaling, speed
from . import Kind, Section, Table


def sections(report, folders):
    """In the order of the page: speed, break-even, correctness, quality of trees, pictures, why."""
    charts = {chart.name: chart for chart in speed.charts(report)}
    take = lambda *names: [charts[name] for name in names if name in charts]
    found = [
        Section("speed", "Speed", "Speed", [], [*take("rays_per_second"), *runs.charts(report)]),
        Section("build", "Build and memory", "Build", [], take("build_time", "memory")),
        Section("pays", "Does a better build pay?", "Break-even", [], pays.charts(report), _crossings(report)),
        Section("accuracy", "Correct at what speed?", "Accuracy", [], accuracy.charts(report)),
        Section("work", "Work per ray", "Work", [], take("visits", "tests", "bytes")),
        Section(
            "why", "Why is one slower than another?", "Why?", _why(), template="explain", data=explain_data(report)
        ),
        Section(
            "predictors",
            "What predicts the time of a tree?",
            "Predictors",
            [],
            [*predictors.charts(report), *overlap.charts(report)],
            _predictors(report),
        ),
        Section("scaling", "Growth with the scene", "Scaling", [], scaling.charts(report), _exponents(report)),
    ]
    shown = pictures.gather(report.runs)
    if shown["scenes"]:
        found.append(Section("pictures", "Pictures", "Pictures", [], template="pictures", data=shown))
    return [s for s in found if s.charts or s.tables or s.template]


def _why():
    return [
        "The gap between two structures, split into visits, primitive tests and bytes, and what each of them costs."
    ]


def explain_data(report):
    """What the panel needs beside the cases: prices by run and scene."""
    return {
        "prices": [
            {"run": run, "label": label} | vars(price) for (run, label), price in explain.prices(report).items()
        ]
    }  # fmt: skip


def _crossings(report):
    found = report.crossings
    found = found[found["rays"] > 0]
    if found.empty:
        return []
    heads = ["scene", "rays", "up to then fastest", "then fastest", "from rays", "interval (95 %)"]
    rows = []
    for r in found.itertuples():
        high = "never" if r.hi == float("inf") else answer.count(r.hi) if r.hi == r.hi else "–"
        rows.append(
            [
                r.label,
                r.rays_label,
                r.before,
                r.after,
                round(r.rays),
                f"{answer.count(r.lo)} to {high}" if r.lo == r.lo else "–",
            ]
        )
        if len(report.runs) > 1:
            rows[-1][0] = f"{r.label} ({r.run})"
    return [Table("break_even_points", "From how many rays which structure is the fastest in total", heads, rows)]


def _predictors(report):
    rows = predictors.table(report)
    if rows.empty:
        return []
    heads = ["rays", "trees", "predictor", "R²", "rank correlation", "wrong sign", "pairs told apart"]
    listed = [
        [r.rays, r.trees, r.predictor, *(None if pd.isna(v) else round(v, 3) for v in (r.r2, r.rank)),
         *(None if pd.isna(v) else int(v) for v in (r.wrong, r.pairs))]
        for r in rows.itertuples()
    ]  # fmt: skip
    return [
        Table(
            "predictor_table",
            "R² of time per ray, Spearman's rank correlation, and pairs of trees put in the wrong order",
            heads,
            listed,
        )
    ]


def _exponents(report):
    rows = scaling.fits(report)
    if rows.empty:
        return []
    heads = ["scene", "structure", "quantity", "sizes", "exponent", "from", "to"]
    listed = [
        [r.family, r.spec, r.quantity, r.sizes, *(round(v, 3) for v in (r.exponent, r.lo, r.hi))]
        for r in rows.itertuples()
    ]
    return [Table("exponents", "Fitted exponents with their intervals of 95 %", heads, listed)]


KIND = Kind("run", "cases.csv", "raybench run", results.read, sections, is_run=True)
