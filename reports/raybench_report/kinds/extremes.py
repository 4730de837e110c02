"""Folders of `raybench extremes`."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ..charts import extremes as charts
from ..results import RunError, read_info, read_table
from . import BAD, GOOD, Kind, Section, Table


@dataclass
class Extremes:
    """What `raybench extremes --out DIR` wrote. NaN means not available."""

    directory: Path
    rows: pd.DataFrame
    info: dict
    shown: str = ""

    @property
    def suites(self):
        """What extremes.json says of each suite that has rows."""
        present = set(self.rows["suite"])
        return [suite for suite in self.info["suites"] if suite["name"] in present]


def read(directory):
    """Reads DIR/extremes.csv and extremes.json. Throws RunError."""
    info = read_info(directory / "extremes.json")
    rows = read_table(directory / "extremes.csv")
    if rows.empty:
        raise RunError(f"{directory / 'extremes.csv'}: no rows, so there is nothing to draw")
    known = {suite.get("name") for suite in info.get("suites", [])}
    if unknown := sorted(set(rows["suite"]) - known):
        raise RunError(f"{directory / 'extremes.json'}: says nothing of the suites {', '.join(unknown)}")
    return Extremes(directory, rows, info)


def sections(report, folders):
    """A section for each folder: broken claims, then a chart a suite."""
    found = []
    for at, folder in enumerate(folders):
        rows = folder.rows
        broken = rows[(rows["status"] == "broken") & (rows["in_range"] == 1)]
        refused = rows[rows["status"] == "refused"].drop_duplicates(["suite", "variant", "magnitude"])
        counted = ", ".join(f"{n:,} {status}" for status, n in rows["status"].value_counts().items())
        lost = "No claim was broken" if broken.empty else f"{len(broken)} claims were broken"
        answer = (GOOD if broken.empty else BAD, f"{len(rows):,} points: {counted}. {lost} within the suites' ranges.")
        says = ["Each chart makes one thing worse from left to right; reports/EXTREMES.md explains each suite."]
        tables = []
        if len(broken):
            tables.append(Table(f"broken_{at}", "Broken claims", ["suite", "variant", "at", "structure", "what"],
                                [[r.suite, r.variant, r.magnitude, r.spec, r.note] for r in broken.itertuples()]))  # fmt: skip
        if len(refused):
            tables.append(Table(f"refused_{at}", "Refused by the scene model at load", ["suite", "variant", "at", "why"],
                                [[r.suite, r.variant, r.magnitude, r.note] for r in refused.itertuples()]))  # fmt: skip
        drawn = charts.charts(folder)
        name = f"extremes_{at}" if at else "extremes"
        for chart in drawn if at else []:
            chart.name += f"_{at}"
        title = "Extremes: where answers begin to fail" + (f" ({folder.shown})" if len(folders) > 1 else "")
        found.append(Section(name, title, "Extremes", says, drawn, tables, answer=answer))
    return found


KIND = Kind("extremes", "extremes.csv", "raybench extremes", read, sections)
