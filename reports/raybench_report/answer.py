"""The answer in a few sentences: what is fastest for which rays, how sure, whether all were correct, what to doubt.

Names of structures and scenes stand in `backticks`; page and Markdown show them as code.
"""

import re

import numpy as np
import pandas as pd

from .charts import overlap, runs
from .results import ERRORS, NULL

SAFE = ("watertight", "exact")  # claims that a run checks and that leave no room for a lost ray


def best(report):
    """One row a run x scene x ray set: the fastest and the next, and the fastest of those that claim to lose no ray.
    Shuffled copies are no kind of ray of their own.

    speed      relative to the anchor on the same rays, or rays per second where there is no anchor
    lead       the fastest's speed over the next one's
    sure       whether their intervals are apart; None where there are none
    """
    if not report.runs:
        return pd.DataFrame()
    cases = report.timed_queries
    cases = cases[(cases["structure"] != NULL) & (cases["order"] != "shuffled")]
    if cases.empty:
        return pd.DataFrame()
    cases = cases[cases["threads"] == cases.groupby(["run", "label"])["threads"].transform("min")]
    against = cases["anchor_ns"].where(cases["anchor_ns"].notna(), 1e9)
    cases = cases.assign(
        speed=against / cases["median_ns"], slow=against / cases["hi_ns"], quick=against / cases["lo_ns"]
    )
    # the anchor against itself on the same rays is 1, whatever its two medians say
    cases.loc[cases["spec"] == cases["anchor"], "speed"] = 1.0
    groups = {}
    for row in cases.itertuples():
        groups.setdefault((row.run, row.label, row.rays_label), []).append(row)
    return pd.DataFrame([_best_of(sorted(here, key=lambda row: -row.speed)) for here in groups.values()])


def _best_of(here):
    """A row of best(): of the cases of one scene and ray set, the fastest first."""
    first, second = here[0], here[1] if len(here) > 1 else None
    safe = next((row for row in here if row.claim in SAFE), None)
    return {
        "run": first.run, "label": first.label, "rays_label": first.rays_label, "query": first.query, "ray_set": first.ray_set,
        "first": first.spec, "rate": first.rate, "claim": first.claim, "errors": first.errors,
        "second": second.spec if second else None, "lead": first.speed / second.speed if second else np.nan,
        "sure": _apart(first, second), "safe": safe.spec if safe else None,
        "safe_rate": safe.rate if safe else np.nan, "safe_part": safe.speed / first.speed if safe else np.nan,
    }  # fmt: skip


def _apart(first, second):
    """Whether the intervals of the first two are apart; None where there is no interval, or no second."""
    if second is None or pd.isna(first.slow) or pd.isna(second.quick):
        return None
    return bool(first.slow > second.quick)


def first_clause(note):
    """Why something was refused, without the ray that shows it."""
    return note.partition("; ray ")[0]


def sentences(report, found):
    """The answer: [(topic, sentence)] over the runs of the report. `found` as best() gives it."""
    if not report.runs:
        return []
    if found.empty:
        return [("speed", "Nothing has a time, so nothing can be called fast: the table below says why.")]
    said = [
        ("speed", _fastest(found, report)),
        ("safe", _safe(report, found)),
        ("refused" if (report.cases["status"] == "refused").any() else "correct", _correct(report)),
    ]
    if text := _changes(report):
        said.insert(0, ("speed", text))
    if text := _builds(report):
        said.append(("build", text))
    if text := _pays(report):
        said.append(("pays", text))
    if text := _overlap(report):
        said.append(("overlap", text))
    if text := _slowest(report):
        said.append(("slow", text))
    return said


def _changes(report):
    """How each later run differs from the first, structure by structure."""
    known = runs.ratios(report)
    if known.empty:
        return ""
    said = []
    for run, here in known.groupby("run", sort=False):
        mean = np.exp(np.log(here["ratio"]).groupby(here["spec"]).mean()).sort_values()
        apart = ((here["hi"] < 1) | (here["lo"] > 1)).groupby(here["spec"]).mean() > 0.5  # in most of its cases
        moved = mean[apart[mean.index] & ((mean < 0.97) | (mean > 1.03))]
        anchor = f", relative to `{here['anchor'].iloc[0]}` on the same rays" if here["anchor"].iloc[0] else ""
        text = f"`{run}` against `{report.names[0]}`{anchor}, over {len(here)} cases: "
        if moved.empty:
            said.append(text + "no structure is faster or slower by more than 3 %, with intervals apart in most cases.")
            continue
        for word, those in (("faster", moved[moved < 1]), ("slower", moved[moved > 1].iloc[::-1])):
            if len(those):
                shown = ", ".join(f"`{spec}` ({value:.2f} times the time)" for spec, value in those.head(4).items())
                text += f"{word} {shown}{' and others' if len(those) > 4 else ''}; "
        rest = mean.drop(moved.index)
        text += (
            f"{len(rest)} others within {100 * np.expm1(np.abs(np.log(rest)).max()):.2g} %"
            if len(rest)
            else "no others"
        )
        said.append(text + ". Two runs that were not interleaved prove no small difference; `raybench check` does.")
    return " ".join(said)


def _fastest(found, report):
    winners = found["first"].value_counts()
    top, scenes = winners.index[0], found["label"].nunique()
    rates = found.loc[found["first"] == top, "rate"] / 1e6
    leads = found.loc[(found["first"] == top) & found["lead"].notna()]
    where = _all(scenes)
    if len(winners) == 1:
        text = f"`{top}` is the fastest for every kind of ray {where}: {_range(rates)} million rays per second"
    else:
        text = (
            f"`{top}` is the fastest in {winners.iloc[0]} of {len(found)} pairs of scene and kind of ray: "
            f"{_range(rates)} million rays per second"
        )
    if len(leads):
        nearest = leads["second"].value_counts().index[0]
        text += f", {_times(leads['lead'])} times as many as the next (mostly `{nearest}`)" if len(set(leads["second"])) > 1 else (
            f", {_times(leads['lead'])} times as many as the next, `{nearest}`")  # fmt: skip
    text += "."
    if len(winners) > 1:
        text += (
            " Elsewhere: "
            + "; ".join(f"`{spec}` for {_places(found[found['first'] == spec], found)}" for spec in winners.index[1:5])
            + ("." if len(winners) <= 5 else "; and others.")
        )
    pairs = found[found["lead"].notna()]
    if len(pairs):
        unsure, unknown = (pairs["sure"].eq(False)).sum(), pairs["sure"].isna().sum()
        if unknown:
            text += f" In {unknown} of {len(pairs)} pairs there are too few samples to say how sure that is."
        if unsure == 0 and not unknown:
            text += " In every pair the intervals of the first two are apart."
        elif unsure:
            text += f" In {unsure} of {len(pairs)} pairs the intervals of the first two overlap: there they cannot be told apart."
    return text


def _places(rows, found):
    """Where it won: "shadow.0 on engine", or a count where that is long."""
    if len(rows) > 3:
        return f"{len(rows)} pairs"
    if found["label"].nunique() == 1:
        return ", ".join(rows["rays_label"])
    return ", ".join(f"{row.rays_label} on `{row.label}`" for row in rows.itertuples())


def _safe(report, found):
    have = found[found["safe"].notna()]
    if have.empty:
        return "No structure that was timed claims that it loses no ray."
    same = have[have["first"] == have["safe"]]
    if len(same) == len(have):
        return "The fastest also claim to lose no ray, and did not in the check."
    top = have["safe"].value_counts()
    parts = have.loc[have["safe"] == top.index[0], "safe_part"]
    text = f"Of the structures that claim to lose no ray, and kept it, `{top.index[0]}` is mostly the fastest"
    text = text.replace("mostly ", "") if len(top) == 1 else text
    return f"{text}: {_range(parts)} of the fastest one's speed."


def _correct(report):
    queries = report.queries[report.queries["structure"] != NULL]
    refused = report.cases[report.cases["status"] == "refused"]
    wrong = queries[(queries["errors"] > 0) & (queries["status"] == "timed")]
    checked = queries["verified"].sum()
    if len(refused):
        names = "; ".join(
            f"`{spec}` on `{label}`: {first_clause(here['note'].iloc[0])}"
            for (spec, label), here in refused.groupby(["spec", "label"], sort=False)
        )
        text = f"Refused, so without any time, because an answer broke what the structure claims: {names}."
    else:
        text = f"Every structure kept what it claims on the {checked:,.0f} answers that were compared with exact truth."
    if len(wrong):
        shares = wrong.groupby("spec")[[*ERRORS, "verified"]].sum()
        shares = (shares[ERRORS].sum(axis=1) / shares["verified"]).sort_values(ascending=False)
        text += (
            " Not exact, and not claimed to be (of all answers compared, rays aimed at edges among them): "
            + ", ".join(f"`{spec}` {_percent(share)} wrong" for spec, share in shares.items())
            + "."
        )
    return text


def _builds(report):
    builds = report.timed_builds
    builds = builds[builds["node_bytes"].fillna(1) > 0]
    if builds.empty:
        return ""
    builds = builds[builds["threads"] == builds["threads"].min()]
    ns = builds.assign(each=builds["median_ns"] / builds["primitives"])
    middle = np.exp(np.log(ns["each"]).groupby(ns["spec"]).mean()).sort_values()
    if len(middle) < 2:
        return f"To build `{middle.index[0]}` takes {middle.iloc[0]:.3g} ns a primitive on one thread."
    first = next(spec for spec in report.order if spec in middle.index)
    text = f"`{middle.index[0]}` builds fastest, at {middle.iloc[0]:,.3g} ns a primitive on {builds['threads_label'].iloc[0]}"
    if first != middle.index[0]:
        text += f"; `{first}` takes {middle[first] / middle.iloc[0]:.2g} times as long"
    return f"{text}; the slowest is `{middle.index[-1]}`, {middle.iloc[-1] / middle.iloc[0]:.2g} times."


def _pays(report):
    found = report.crossings
    camera = found[(found["rays_label"] == found["rays_label"].iloc[0]) & (found["rays"] > 0)] if len(found) else found
    if camera.empty:
        return ""
    last, several = camera.groupby(["run", "label"]).tail(1), len(report.runs) > 1
    parts = [
        f"`{row.after}` from {count(row.rays)} {row.rays_label} rays on `{row.label}`{f' ({row.run})' if several else ''}"
        f"{_rays_interval(row)}, before that `{row.before}`"
        for row in last.head(3).itertuples()
    ]
    return f"A dearer build pays: {'; '.join(parts)}."


def _rays_interval(row):
    if pd.isna(row.lo):
        return ""
    return f" [{count(row.lo)}, {count(row.hi) if np.isfinite(row.hi) else 'never'}]"


def _overlap(report):
    """When cells that do not overlap win over boxes that do."""
    pairs = overlap.rows(report)
    if pairs.empty or (won := pairs[pairs["ratio"] > 1]).empty:
        return ""
    top = won.loc[won["ratio"].idxmax()]
    boxes = f"EPO {top['epo']:.3g}"
    if pairs["label"].nunique() > 1 and top["epo"] == pairs["epo"].max():
        boxes = f"where the BVH's boxes overlap most, {boxes}"
    return (
        f"A kd-tree, whose cells do not overlap, is faster than the fastest binary BVH in {len(won)} of {len(pairs)} pairs: at most "
        f"{top['ratio']:.2g} times as fast, `{top['kdtree']}` for {top['rays_label']} rays on `{top['label']}` ({boxes})."
    )


def _slowest(report):
    """The worst case against its anchor, with what explains it."""
    cases = report.timed_queries
    cases = cases[(cases["structure"] != NULL) & cases["anchor_ns"].notna() & (cases["spec"] != cases["anchor"])]
    cases = cases[cases["order"] != "shuffled"]
    if cases.empty:
        return ""
    slow = cases["median_ns"] / cases["anchor_ns"]
    if slow.max() < 20:
        return ""
    worst = cases.loc[slow.idxmax()]
    text = f"Far behind: `{worst['spec']}` for {worst['rays_label']} rays on `{worst['label']}`, {slow.max():,.0f} times as slow as `{worst['anchor']}`"
    if worst["prims"] > 0:
        text += f", with {worst['prims']:,.0f} primitive tests and {worst['steps']:,.0f} visits a ray"
    return text + "."


def doubts(report):
    """What to doubt, one sentence each, with the runs that it is true of where there are several."""
    said = {}
    for run in report.runs:
        for text in _doubts_of(run):
            said.setdefault(text, []).append(run.shown)
    named = lambda names: "All runs: " if len(names) == len(report.runs) > 1 else f"{', '.join(names)}: "
    return [(named(names) if len(report.runs) > 1 else "") + text for text, names in said.items()]


def _doubts_of(run):
    info, said = run.info, []
    if info.get("interrupted"):
        said.append(f"The run was interrupted: {len(run.cases):,} cases are finished{_gone(run)}.")
    cases = run.cases[(run.cases["structure"] != NULL) & (run.cases["status"] == "timed")]
    skipped = run.cases[(run.cases["status"] == "skipped") & (run.cases["structure"] != NULL)]
    for note, here in skipped.groupby("note", sort=False):
        said.append(f"Skipped, so without a time: {_each(here, run.cases['label'].nunique())} ({note}).")
    wide = (cases["hi_ns"] - cases["lo_ns"]) / cases["median_ns"]
    known = wide.notna().sum()
    if known and (wide > 0.1).sum():
        said.append(
            f"{(wide > 0.1).sum()} of {known} intervals are wider than 10 % of their median; half are wider than {100 * wide.median():.2g} %."
        )
    if len(cases) > known:
        said.append(f"{len(cases) - known} times have too few samples for an interval.")
    if info.get("quick"):
        said.append(
            f"A quick run: {info.get('rays_per_set', 0):,} rays a set, few samples. Good for a look, not for a paper."
        )
    machine = info.get("machine", {})
    if "hypervisor" in str(machine.get("cpu_flags", "")).split():
        said.append("Measured in a virtual machine, whose processor others may share: trust ratios more than times.")
    embree = info.get("libraries", {}).get("embree")
    if embree and "Debian" in str(machine.get("os", "")) and cases["structure"].str.startswith("embree").any():
        said.append(
            f"Embree {embree.get('version', '')} is Debian's package, compiled with its assertions: a build without them may be faster."
        )
    if info.get("build", {}).get("build_type", "Release") != "Release":
        said.append(f"raybench was built as {info['build']['build_type']}, not as Release: times mean little.")
    return said + [str(warning) for warning in info.get("warnings") or []]


def _gone(run):
    """What an interrupted run never measured: whole scenes, then structures by scene."""
    scenes, planned = {}, {s.get("spec") for s in run.info.get("structures", [])} - {NULL}
    for spec, scene in missing(run):
        scenes.setdefault(scene, []).append(spec)
    whole = [f"`{scene}`" for scene, specs in scenes.items() if len(specs) == len(planned)]
    parts = ["anything on " + ", ".join(whole)] if whole else []
    parts += [
        ", ".join(f"`{spec}`" for spec in specs) + f" on `{scene}`"
        for scene, specs in scenes.items()
        if len(specs) < len(planned)
    ]
    return "; never measured: " + "; ".join(parts) if parts else ""


def _each(cases, scenes):
    """Which structures on which scenes."""
    parts = []
    for spec, here in cases.groupby("spec", sort=False):
        labels = list(here["label"].unique())
        everywhere = len(labels) == scenes > 1
        parts.append(f"`{spec}` on " + (_all(scenes)[3:] if everywhere else ", ".join(f"`{x}`" for x in labels)))
    return "; ".join(parts)


def missing(run):
    """[(structure, scene)] of an interrupted run that have no case at all."""
    planned = [s.get("spec") for s in run.info.get("structures", [])]
    have = set(zip(run.cases["spec"], run.cases["scene"], strict=True))
    scenes = list(dict.fromkeys([*run.cases["scene"], *(s.get("scene") for s in run.info.get("scenes", []))]))
    return [
        (spec, scene) for scene in scenes for spec in planned if spec and spec != NULL and (spec, scene) not in have
    ]


def count(value):
    """A number of rays in words: 1,240; 52 thousand; 3.1 million."""
    for size, word in ((1e9, " billion"), (1e6, " million"), (1e4, " thousand")):
        if value >= size:
            return f"{value / (1e3 if word == ' thousand' else size):,.3g}{word}"
    return f"{value:,.0f}"


def _range(values):
    low, high = f"{values.min():.2g}", f"{values.max():.2g}"
    return low if low == high else f"{low} to {high}"


def _all(scenes):
    """Where something holds everywhere."""
    return "on the scene" if scenes == 1 else "on both scenes" if scenes == 2 else f"on all {scenes} scenes"


def _times(values):
    low, high = f"{values.min():.2f}", f"{values.max():.2f}"
    return low if low == high else f"{low} to {high}"


def _percent(share):
    return f"{100 * share:.2g} %"


def plain(text):
    """Without backticks."""
    return re.sub(r"`([^`]*)`", r"\1", text)
