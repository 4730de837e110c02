"""Folders of `raybench verify`."""

import os
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..charts import verdicts
from ..results import ERRORS, RunError, read_info, read_table
from . import BAD, GOOD, Kind, Section, Table


@dataclass
class Verification:
    """What `raybench verify --out DIR` wrote."""

    directory: Path
    rows: pd.DataFrame
    info: dict
    shown: str = ""


def read(directory):
    """Reads DIR/verdicts.csv and verify.json. Throws RunError."""
    rows = read_table(directory / "verdicts.csv")
    if rows.empty:
        raise RunError(f"{directory / 'verdicts.csv'}: no rows, so there is nothing to show")
    label = rows["scene"].map(lambda name: name if "(" in name else os.path.basename(name))
    return Verification(directory, rows.assign(label=label), read_info(directory / "verify.json"))


def sections(report, folders):
    """Broken claims first, then error rates."""
    rows = pd.concat([folder.rows.assign(run=folder.shown) for folder in folders], ignore_index=True)
    broken = rows[rows["held"] == 0]
    trees = rows.drop_duplicates(["run", "scene", "spec"])
    lost = broken.drop_duplicates(["run", "scene", "spec"])
    kept = (
        "all trees kept what they claim." if lost.empty else f"{len(lost)} of {len(trees)} trees broke what they claim."
    )
    answer = (
        GOOD if lost.empty else BAD,
        f"{rows['rays'].sum():,.0f} answers of {len(trees)} trees were judged, every one: {kept}",
    )
    says = []
    if any(folder.info.get("interrupted") for folder in folders):
        says.append("Interrupted: what is missing was not judged.")
    heads = ["scene", "structure", "claims", "rays", "query", "judged", *ERRORS, "kept"]
    listed = [
        [
            r.label,
            r.spec,
            r.claim,
            r.ray_set,
            r.query,
            r.rays,
            *(getattr(r, e) for e in ERRORS),
            "yes" if r.held else "NO",
        ]
        for r in pd.concat([broken, rows[rows["held"] != 0]]).itertuples()
    ]
    tables = [Table("verify_rows", "Every tree and ray set", heads, listed)]
    title = "Verification: does a structure lose rays?"
    return [Section("verify", title, "Verify", says, verdicts.charts(rows), tables, answer=answer)]


KIND = Kind("verify", "verdicts.csv", "raybench verify", read, sections)
