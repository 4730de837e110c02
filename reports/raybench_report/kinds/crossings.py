"""Folders of `raybench verify --crossings`."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..results import read_table
from . import BAD, GOOD, Kind, Section, Table


@dataclass
class Crossings:
    """What `raybench verify --crossings N --out DIR` wrote."""

    directory: Path
    rows: pd.DataFrame
    shown: str = ""


def sections(report, folders):
    """Points told inside from outside, by structure and way."""
    rows = pd.concat([folder.rows.assign(run=folder.shown) for folder in folders], ignore_index=True)
    broken = rows[rows["held"] == 0].drop_duplicates(["run", "scene", "spec"])
    kept = f"{len(broken)} trees broke what they claim." if len(broken) else "all trees kept what they claim."
    answer = (
        GOOD if broken.empty else BAD,
        f"{rows['points'].sum():,.0f} points were told inside from outside; {kept}",
    )
    heads = ["scene", "structure", "claims", "way", "points", "wrong", "wrong at most (95 %)", "ns a point", "kept"]
    listed = [
        [r.scene, r.spec, r.claim, r.way, r.points, r.wrong, r.wrong_upper, r.ns_per_point, "yes" if r.held else "NO"]
        for r in rows.itertuples()
    ]
    table = Table("crossings_rows", "Ways", heads, listed)
    return [
        Section("crossings", "Crossings: inside or outside?", "Crossings", [], [], [table], answer=answer),
    ]


KIND = Kind(
    "crossings", "crossings.csv", "raybench verify --crossings",
    lambda directory: Crossings(directory, read_table(directory / "crossings.csv")), sections,
)  # fmt: skip
