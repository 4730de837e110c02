"""Times of result folders, as decisions use them: one value for each comparison and each process."""

import csv
from dataclasses import dataclass
from statistics import median

import numpy as np

from .. import columns, results

KEY = ["scene", "spec", "ray_set", "order", "query", "threads"]


@dataclass(frozen=True, order=True)
class Comparison:
    """What is compared between two programs: a case without what may change (`params`, hashes), or all ray sets of a
    structure together (`ray_set` is ALL_SETS)."""

    scene: str
    spec: str
    ray_set: str
    order: str
    query: str
    threads: int

    @property
    def name(self):
        """Scene / structure / ray set, with what is not usual."""
        parts = [self.scene, self.spec, self.ray_set + ("~" if self.order == "shuffled" else "")]
        if self.threads != 1:
            parts.append(f"{self.threads} threads")
        return " / ".join(part for part in parts if part)

    @property
    def is_summary(self):
        return self.ray_set == ALL_SETS


ALL_SETS = "all ray sets"


def read_cases(folder):
    """cases.csv, after run.json has been found to be of this format. Scenes are called as short_names() does, so that
    the worktrees of two commits have scenes of the same name. Throws RunError."""
    results.read_info(folder / "run.json")
    cases = results.read_table(folder / "cases.csv")
    return cases.assign(scene=cases["scene"].map(results.short_names(cases["scene"].unique())))


def read_rows(folder):
    """cases.csv row by row, every field as text, with scenes as read_cases() has them. Columns may be fewer than this
    raybench knows, or more: another version may have written it. Throws RunError."""
    results.read_info(folder / "run.json")
    rows = _rows(folder / "cases.csv")
    needed = {*KEY, "case_id", "structure", "status", "timed_rays"}
    if rows and (absent := needed - set(rows[0])):
        raise results.RunError(f"{folder / 'cases.csv'}: missing columns: {', '.join(sorted(absent))}")
    if any(None in row or None in row.values() for row in rows):
        raise results.RunError(f"{folder / 'cases.csv'}: a line has more or fewer fields than the first")
    names = results.short_names(dict.fromkeys(row["scene"] for row in rows))
    return [{**row, "scene": names[row["scene"]]} for row in rows]


def comparison_of(row):
    return Comparison(*(row[name] for name in KEY[:-1]), int(row["threads"]))


@dataclass(frozen=True)
class Times:
    """Of one process. `ns`: median time over the samples of a case; `rays`: how many of its rays were timed, which two
    processes must have in common."""

    ns: dict
    rays: dict

    def relative_to(self, anchor):
        """Each time as a ratio to the anchor's on the same rays; cases without one, and the anchor's own, are left
        out."""
        ns = {}
        for c, value in self.ns.items():
            beside = Comparison(c.scene, anchor, c.ray_set, c.order, c.query, c.threads)
            if beside != c and beside in self.ns and self.rays[beside] == self.rays[c]:
                ns[c] = value / self.ns[beside]
        return Times(ns, {c: self.rays[c] for c in ns})


def times_of(folder):
    """A list of Times, one for each process that the folder has samples of, from samples.csv. Throws RunError."""
    timed = {row["case_id"]: row for row in read_rows(folder) if row["status"] == "timed"}
    taken = {}
    try:
        for row in _rows(folder / "samples.csv"):
            if row["case_id"] in timed:
                seconds = float(row["cpu_seconds"] if row["threads"] == "1" else row["seconds"])
                taken.setdefault(row.get("session") or "0", {}).setdefault(row["case_id"], []).append(seconds)
        found = []
        for of_session in taken.values():
            ns, rays = {}, {}
            for case_id, seconds in of_session.items():
                c = comparison_of(timed[case_id])
                rays[c] = None if c.query == "build" else int(timed[case_id]["timed_rays"])
                ns[c] = median(seconds) * 1e9 / (rays[c] or 1)
            found.append(Times(ns, rays))
    except (KeyError, ValueError) as error:
        raise results.RunError(f"{folder / 'samples.csv'}: not what `raybench run` wrote: {error}") from None
    if not found:
        raise results.RunError(f"{folder / 'samples.csv'}: no case has a time")
    return found


def _rows(path):
    """Read without pandas, which takes longer than a small run."""
    try:
        with open(path, newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise results.RunError(f"{path}: {error.strerror}") from None


@dataclass(frozen=True)
class Ratios:
    """Rows of log(B/A), one a comparison, columns in the order of the pairs; what could not be compared, and why."""

    comparisons: list
    log_ratios: np.ndarray
    left_out: dict


def ratios_of(pairs, builds=True):
    """Of pairs of Times (A, B). A comparison that some process lacks, or timed on another part of the rays, is left
    out. Each structure with more than one ray set gets a row for all of them: the median of their log-ratios. What
    disturbs a process disturbs a few sets, so that their mean would be several times as noisy."""
    first = pairs[0][0]
    wanted = [c for c in first.ns if builds or c.query != "build"]
    left_out, kept, rows = {}, [], []
    for c in wanted:
        if any(c not in side.ns for pair in pairs for side in pair):
            left_out[c] = "has no time in some process"
        elif len({side.rays[c] for pair in pairs for side in pair}) > 1:
            left_out[c] = "timed on different parts of its rays; give a larger --budget"
        else:
            kept.append(c)
            rows.append([np.log(b.ns[c] / a.ns[c]) for a, b in pairs])
    for c in {c for pair in pairs for c in pair[1].ns} - set(first.ns):
        left_out[c] = "is new: there is nothing to compare it with"
    return with_summaries(Ratios(kept, np.array(rows).reshape(len(rows), len(pairs)), left_out))


def with_summaries(ratios):
    """The same with a row for all ray sets of each structure and scene."""
    groups = {}
    for i, c in enumerate(ratios.comparisons):
        if c.query != "build":
            groups.setdefault((c.scene, c.spec, c.threads), []).append(i)
    comparisons, rows = list(ratios.comparisons), list(ratios.log_ratios)
    for (scene, spec, threads), members in groups.items():
        if len(members) > 1:
            comparisons.append(Comparison(scene, spec, ALL_SETS, "", "", threads))
            rows.append(np.median(ratios.log_ratios[members], axis=0))
    return Ratios(comparisons, np.array(rows).reshape(len(rows), -1), ratios.left_out)


def deterministic_columns():
    """The columns of cases.csv that must agree between two runs, besides those that name the case."""
    named = {*KEY, "case_id", "oracle", "note", "anchor", "structure", "seed"}
    return [name for name, *_, varies, _ in columns.columns_of("cases.csv") if not varies and name not in named]
