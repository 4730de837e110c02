"""Reads and checks the files of a run."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from . import columns
from .errors import RunError

VERDICTS = [
    "exact", "tie", "neighbour", "leak", "wrong", "wrong_marginal", "false_miss", "false_miss_marginal", "false_hit",
    "false_hit_marginal",
]  # fmt: skip

# Plainly wrong answers; marginal ones do not count.
ERRORS = ["leak", "wrong", "false_miss", "false_hit"]

# The structure that always misses: what it costs is the harness's own cost.
NULL = "null"


@dataclass
class Run:
    """A run as read. NaN means not available. `cases` has these columns besides those of cases.csv:

    label        scene as shown: without its folders where that is unambiguous
    threads_label  "1 thread"
    rays_label   ray set as shown: with its order where shuffled, and with its query where any hit ends it
    errors       share of the verified rays answered wrongly: leak, wrong, false_miss, false_hit; marginal ones do
                 not count
    """

    directory: Path
    cases: pd.DataFrame
    samples: pd.DataFrame
    info: dict
    shown: str = ""  # its name in a report


def read(directory):
    """Reads DIR/cases.csv, samples.csv and run.json. Throws RunError."""
    directory = Path(directory)
    if not directory.is_dir():
        raise RunError(f"{directory}: no such directory")
    info = read_info(directory / "run.json")
    cases = read_table(directory / "cases.csv")
    samples = read_table(directory / "samples.csv")
    if cases.empty:
        raise RunError(f"{directory / 'cases.csv'}: no cases, so there is nothing to show")
    _mark_software(cases, samples, info)
    return Run(directory, _with_labels(cases), samples, info)


def _mark_software(cases, samples, info):
    """What a software driver did in a device's place is never shown under the device's name."""
    software = set(cases.loc[cases["device"].str.startswith("software: "), "spec"])
    names = {spec: f"{spec} [software]" for spec in software}
    for table in (cases, samples):
        table["spec"] = table["spec"].replace(names)
    for structure in info.get("structures") or []:
        structure["spec"] = names.get(structure.get("spec"), structure.get("spec"))


def timed(cases):
    """The cases that have a time."""
    return cases[(cases["status"] == "timed") & cases["median_ns"].notna()]


def write_atomically(path, write):
    """Calls write(temporary path of the same suffix), then renames it to `path`."""
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def read_table(path):
    """A CSV table that stands in columns.json; text that is absent is empty, numbers NaN. Throws RunError."""
    if not path.is_file():
        raise RunError(f"{path}: missing; is this what `raybench run --out DIR` wrote?")
    try:
        # only the empty field is "not available": pandas would take the structure named null for it too
        table = pd.read_csv(path, dtype=str, keep_default_na=False, na_values=[""])
    except (ValueError, UnicodeDecodeError) as error:  # pandas' own errors are ValueErrors
        raise RunError(f"{path}: not a CSV table: {' '.join(str(error).split())}") from None
    types = {name: kind for name, kind, *_ in columns.columns_of(path.name)}
    text = [name for name, kind in types.items() if kind == "text"]
    numbers = [name for name in types if name not in text]
    for column in columns.later(path.name):
        if column not in table.columns:
            table[column] = None
    absent = [column for column in types if column not in table.columns]
    if absent:
        raise RunError(f"{path}: missing columns: {', '.join(absent)}")
    for column in numbers:
        values = pd.to_numeric(table[column], errors="coerce")
        bad = table.index[values.isna() & table[column].notna()]
        if len(bad):
            raise RunError(f"{path}: line {bad[0] + 2}, column {column}: '{table.at[bad[0], column]}' is not a number")
        table[column] = values
    table[text] = table[text].fillna("")
    return table


def read_json(path):
    """A file with one JSON object. Throws RunError."""
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RunError(f"{path}: missing; is this what `raybench run --out DIR` wrote?") from None
    except ValueError as error:
        raise RunError(f"{path}: not JSON: {error}") from None
    if not isinstance(info, dict):
        raise RunError(f"{path}: not a JSON object")
    return info


def read_info(path):
    """run.json, verify.json or extremes.json, of the result format that this program reads. Throws RunError."""
    info = read_json(path)
    if info.get("format") != columns.FORMAT:
        raise RunError(
            f"{path}: result format {info.get('format', 'unknown')}; this raybench reads {columns.FORMAT}: measure again, "
            "or use the raybench that wrote it"
        )
    return info


def short_names(scenes):
    """{scene: name}: files without their folders; as they are where that would mix scenes up."""
    short = {scene: scene if "(" in scene else os.path.basename(scene) for scene in scenes}
    return short if len(set(short.values())) == len(short) else {scene: scene for scene in scenes}


def rays_label(ray_set, order, query):
    """A ray set as shown: with its order where shuffled, and with its query where any hit ends it; `build` for builds."""
    if query == "build":
        return "build"
    return ray_set + (", shuffled" if order == "shuffled" else "") + (" (any hit)" if query == "any" else "")


def _with_labels(cases):
    order = cases["order"].map({"shuffled": ", shuffled"}).fillna("")
    query = cases["query"].map({"any": " (any hit)"}).fillna("")
    return cases.assign(
        label=cases["scene"].map(short_names(cases["scene"].unique())),
        rays_label=cases["ray_set"] + order + query,
        threads_label=cases["threads"].map(
            lambda n: "" if pd.isna(n) else "1 thread" if n == 1 else f"{n:.0f} threads"
        ),
        errors=cases[ERRORS].sum(axis=1, min_count=4) / cases["verified"].where(cases["verified"] > 0),
    )
