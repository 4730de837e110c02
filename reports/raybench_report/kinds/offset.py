"""Folders of `raybench offset`."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..results import read_info, read_table
from . import BAD, GOOD, Kind, Section, Table


@dataclass
class Offset:
    """What `raybench offset SCENE --out DIR` wrote."""

    directory: Path
    rows: pd.DataFrame
    info: dict
    shown: str = ""


def read(directory):
    """The folder's tables."""
    info = read_info(directory / "offset.json")
    return Offset(directory, read_table(directory / "offset.csv"), {k: v for k, v in info.items() if k != "rows"})


def sections(report, folders):
    """Cures of self-intersection, and from where to where their offsets are safe."""
    rows = pd.concat([folder.rows.assign(run=folder.shown) for folder in folders], ignore_index=True)
    named = rows[rows["role"] == "named"]
    unsafe = [scene for scene, group in named.groupby("scene", sort=False) if not group["safe"].any()]
    answer = (
        BAD if unsafe else GOOD,
        f"No cure of self-intersection is safe on {', '.join(unsafe)}."
        if unsafe
        else "Each scene has a cure with no self-hit and no lost hit.",
    )
    heads = ["scene", "structure", "cure", "safe from", "to", "offset", "rays", "self-hits", "lost hits", "ns a ray", "safe"]
    listed = []
    for r in named.itertuples():
        own = rows[(rows["run"] == r.run) & (rows["scene"] == r.scene) & (rows["cure"] == r.cure)]
        ends = [own.loc[own["role"] == role, "offset"].tolist() for role in ("smallest_safe", "largest_safe")]
        ends = [end[0] if end and r.safe else None for end in ends]
        offset = None if pd.isna(r.offset) else r.offset
        listed.append(
            [r.scene, r.spec, r.cure, *ends, offset, r.rays, r.self_hits, r.lost, r.ns_per_ray, "yes" if r.safe else "NO"]
        )
    table = Table("offset_rows", "Cures of self-intersection", heads, listed)
    says = [f"{folder.rows['scene'].iloc[0]}: {folder.info['advice']}" for folder in folders]
    return [Section("offset", "Rays that leave surfaces: safe offsets", "Offsets", says, [], [table], answer=answer)]


KIND = Kind("offset", "offset.csv", "raybench offset", read, sections)
