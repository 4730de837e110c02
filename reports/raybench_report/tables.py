"""The tables that sort, filter and pin: their columns, for page, LaTeX and Markdown alike."""

from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd

from .results import ERRORS, NULL


@dataclass
class Column:
    """factor   the value shown is the stored one times this
    digits   significant ones
    better   "low" or "high" where one is; such columns show ratios when a structure is pinned
    paper    whether LaTeX and Markdown tables have it
    """

    key: str
    head: str
    kind: str = "text"  # or number, count, share, interval
    factor: float = 1.0
    digits: int = 3
    better: str | None = None
    paper: bool = True
    help: str = ""


STRUCTURES = [
    Column("run", "run"),
    Column("label", "scene"),
    Column("spec", "structure"),
    Column("verdict", "verdict", help="What it claims, and whether the answers compared with exact truth kept it"),
    Column("closest", "closest hit, × anchor", "number", digits=2, better="high", help="Speed relative to the run's anchor on the same rays: geometric mean over all closest-hit ray sets"),
    Column("any", "any hit, × anchor", "number", digits=2, better="high", help="The same over shadow and ambient-occlusion rays, whose search any hit ends"),
    Column("build_one", "build, ms, 1 thread", "number", 1e-6, better="low"),
    Column("build_all", "build, ms, all threads", "number", 1e-6, better="low"),
    Column("memory", "MB", "number", 1e-6, better="low", help="Nodes and copied primitives"),
    Column("sah_cost", "SAH cost", "number", digits=4, better="low"),
    Column("epo", "EPO", "number", better="low", paper=False, help="End-point overlap"),
    Column("depth", "depth", "count", paper=False),
    Column("inner_nodes", "inner nodes", "count", paper=False),
    Column("leaf_nodes", "leaves", "count", paper=False),
    Column("references", "references", "count", paper=False),
    Column("leaf_depth", "leaf depth", "number", paper=False),
    Column("tightness", "P(hit | bound hit)", "number", paper=False),
]  # fmt: skip

RAYS = [
    Column("run", "run"),
    Column("label", "scene"),
    Column("spec", "structure"),
    Column("rays_label", "rays"),
    Column("threads", "threads", "count", paper=False),
    Column("rate", "million rays/s", "number", 1e-6, better="high"),
    Column("median_ns", "ns per ray", "number", digits=4, better="low"),
    Column("interval", "interval of 95 %", "interval", paper=False, help="ns per ray"),
    Column("steps", "visits", "number", digits=4, better="low", help="Nodes or cells visited per ray"),
    Column("prims", "tests", "number", digits=4, better="low", help="Ray-primitive tests per ray"),
    Column("bytes", "bytes", "number", digits=4, better="low", paper=False, help="Bytes touched per ray"),
    Column("errors", "wrong", "share", digits=2, help="Share of the verified rays answered wrongly"),
    Column("status", "status"),
    Column("verified", "verified", "count", paper=False),
    Column("claim", "claims", paper=False),
    Column("timed_rays", "timed rays", "count", paper=False, help="Rays of a pass that was timed"),
]  # fmt: skip

# What a row of STRUCTURES is made of.
ASKED = [
    "run", "label", "spec", "structure", "query", "order", "threads", "status", "note", "claim", "verified", *ERRORS,
    "median_ns", "anchor", "anchor_ns", "node_bytes", "prim_bytes",
]  # fmt: skip

EXACT_CLASSES = {"nothing": "claims nothing", "inexact": "inexact"}


def columns(table, report):
    """The columns as dictionaries, without `run` where there is only one."""
    return [asdict(c) for c in table if c.key != "run" or len(report.runs) > 1]


def structures(report):
    """One row a run x scene x structure."""
    cases = report.cases[report.cases["structure"] != NULL]
    figures = ["sah_cost", "epo", "depth", "inner_nodes", "leaf_nodes", "references", "leaf_depth", "tightness"]
    tree, rows = cases.groupby(["run", "label", "spec"])[figures].max(), []
    cases = cases[ASKED]  # choosing rows of a table takes as long as it has columns
    for (run, label, spec), here in cases.groupby(["run", "label", "spec"], sort=False):
        mine, asked = here[here["query"] == "build"], here[here["query"] != "build"]
        one, every = mine[mine["threads"] == mine["threads"].min()], mine[mine["threads"] == mine["threads"].max()]
        row = {
            "run": run,
            "label": label,
            "spec": spec,
            "structure": here["structure"].iloc[0],
            "verdict": verdict(here, asked),
        }
        row["status"] = worst(here["status"])
        for name, query in (("closest", "closest"), ("any", "any")):
            row[name] = _speed(asked[asked["query"] == query])
        row["build_one"] = one["median_ns"].max() if len(one) and one["threads"].iloc[0] == 1 else np.nan
        row["build_all"] = every["median_ns"].max() if len(every) and every["threads"].iloc[0] > 1 else np.nan
        row["memory"] = here[["node_bytes", "prim_bytes"]].max().sum(min_count=1)
        row |= tree.loc[(run, label, spec)].to_dict()
        rows.append(row)
    place = {spec: at for at, spec in enumerate(report.order)}
    scene = {label: at for at, label in enumerate(report.scenes)}
    runs = {name: at for at, name in enumerate(report.names)}
    return pd.DataFrame(sorted(rows, key=lambda r: (scene[r["label"]], place[r["spec"]], runs[r["run"]])))


def worst(statuses):
    """refused before skipped before timed."""
    present = set(statuses)
    return next((s for s in ("refused", "skipped", "interrupted", "timed") if s in present), "")


def verdict(cases, queries):
    """What the tree claims and whether its answers kept it."""
    if (cases["status"] == "refused").any():
        return f"REFUSED: {cases.loc[cases['status'] == 'refused', 'note'].iloc[0].partition('; ray ')[0]}"
    checked = queries[queries["verified"] > 0]
    if checked.empty:
        skipped = cases.loc[cases["status"] == "skipped", "note"]
        return f"skipped: {skipped.iloc[0]}" if len(skipped) else "not checked"
    claim, wrong = checked["claim"].iloc[0], checked[ERRORS].sum().sum()
    if wrong == 0:
        return f"{claim}: kept" if claim not in EXACT_CLASSES else f"{EXACT_CLASSES[claim]}: none wrong"
    share = 100 * wrong / checked["verified"].sum()
    return f"{EXACT_CLASSES.get(claim, claim)}: {share:.2g} % wrong"


def _speed(cases):
    """Geometric mean of the speed relative to the anchor on the same rays."""
    cases = cases[(cases["status"] == "timed") & cases["anchor_ns"].notna() & (cases["order"] != "shuffled")]
    if cases.empty:
        return np.nan
    cases = cases[cases["threads"] == cases["threads"].min()]
    if (cases["spec"] == cases["anchor"]).all():
        return 1.0
    return float(np.exp(np.log(cases["anchor_ns"] / cases["median_ns"]).mean()))


def shown(row, column):
    """A cell's text; a dash where nothing is known."""
    if column.kind == "interval":
        low, high = row["lo_ns"], row["hi_ns"]
        return "–" if pd.isna(low) or pd.isna(high) else f"{figure(low, 4)} to {figure(high, 4)}"
    value = row[column.key]
    if column.kind == "text":
        return str(value) if value not in ("", None) else "–"
    if pd.isna(value):
        return "–"
    if column.kind == "count":
        return f"{value:,.0f}"
    return f"{100 * value:.2g} %" if column.kind == "share" else figure(value * column.factor, column.digits)


def figure(value, digits):
    """Significant digits without an exponent: 0.0123, 4.56, 78.9, 1,230."""
    if value == 0:
        return "0"
    places = max(0, digits - 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:,.{places}f}"
