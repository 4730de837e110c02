"""What one report shows: the folders given to `raybench report`, read, named and put together."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from .charts import pays
from .results import NULL, RunError, timed

KINDS = ["camera", "shadow", "reflection", "refraction"]  # of the tracer's ray sets, first in every list


@dataclass
class Report:
    """`runs`: as results.read() gives them, each with its `name` as shown. `others`: folders of other kinds."""

    runs: list = field(default_factory=list)
    others: list = field(default_factory=list)

    @cached_property
    def cases(self):
        """All cases of all runs, with the column `run`."""
        if not self.runs:
            return pd.DataFrame()
        return pd.concat([run.cases.assign(run=run.shown) for run in self.runs], ignore_index=True)

    @cached_property
    def builds(self):
        """Build cases."""
        return self.cases[self.cases["query"] == "build"]

    @cached_property
    def queries(self):
        """Cases that trace rays."""
        return self.cases[self.cases["query"] != "build"]

    @cached_property
    def timed_cases(self):
        return timed(self.cases)

    @cached_property
    def timed_queries(self):
        return timed(self.queries)

    @cached_property
    def timed_builds(self):
        """But for `null`, which builds nothing."""
        return timed(self.builds[self.builds["structure"] != NULL])

    @property
    def names(self):
        """The runs as shown, in the order in which they were given."""
        return [run.shown for run in self.runs]

    @cached_property
    def order(self):
        """Structures from fast to slow, by the geometric mean of their ratio to the anchor; those without time last."""
        cases = self.timed_queries
        cases = cases[cases["structure"] != NULL]
        relative = np.log(
            (cases["anchor_ns"] / cases["median_ns"]).where(cases["anchor_ns"].notna(), 1e9 / cases["median_ns"])
        )
        known = list(relative.groupby(cases["spec"]).mean().sort_values(ascending=False).index)
        rest = sorted(set(self.cases.loc[self.cases["structure"] != NULL, "spec"]) - set(known))
        return known + rest

    @cached_property
    def ray_sets(self):
        """Ray sets as shown: those the tracer recorded first, by kind and depth; shuffled copies last."""
        first = self.queries.drop_duplicates("rays_label")

        def key(row):
            kind, _, depth = row.ray_set.partition(".")
            rank = KINDS.index(kind) if kind in KINDS else len(KINDS)
            return row.order == "shuffled", rank, kind, depth.zfill(4), row.query

        return [row.rays_label for row in sorted(first.itertuples(), key=key)]

    @cached_property
    def scenes(self):
        """Scenes as shown, in the order of the files."""
        return list(self.cases["label"].unique())

    @cached_property
    def totals(self):
        """See charts/pays.py."""
        return pays.totals(self)

    @cached_property
    def crossings(self):
        """See charts/pays.py."""
        return pays.crossings(self)

    @cached_property
    def sample_times(self):
        """(run, case_id) → times of the samples behind the median, in ns: of the whole build, or per ray."""
        found = {}
        for run in self.runs:
            samples = run.samples
            alone = samples["threads"] == 1
            seconds = samples["cpu_seconds"].where(alone & samples["cpu_seconds"].notna(), samples["seconds"])
            each = (seconds * 1e9 / samples["rays"].fillna(1)).to_numpy()
            for case, at in samples.groupby("case_id", sort=False).indices.items():
                found[run.shown, case] = each[at]
        return found


def read(directories, kinds):
    """Reads folders, each by the first of `kinds` whose file it holds. Throws RunError."""
    report, names = Report(), set()
    for directory in map(Path, directories):
        if not directory.is_dir():
            raise RunError(f"{directory}: no such directory")
        kind = next((kind for kind in kinds if kind.holds(directory)), None)
        if kind is None:
            wanted = ", ".join(f"{kind.marker} ({kind.command})" for kind in kinds)
            raise RunError(f"{directory}: not a result folder: it has none of {wanted}")
        folder = kind.read(directory)
        name, count = directory.resolve().name, 2
        while (shown := name if name not in names else f"{name} ({count})") in names:
            count += 1
        names.add(shown)
        folder.shown = shown
        (report.runs if kind.is_run else report.others).append(folder)
    return report
