"""Speed, memory and errors of structures: one `raybench run` and one `raybench verify` for all points of a scene."""

import shutil

import numpy as np

from ..results import ERRORS, RunError, read_table
from . import knobs
from .pareto import rate_interval

AIMED = ("aimed_vertex", "aimed_edge")  # of verify: what `aimed` of run is
FEWEST_SECONDS = 0.004  # of timing, a case
SAFE = 0.7  # of a sample: the slowest may be slower in the next run
FEWEST_RAYS = 1024  # a set: `raybench run` makes no smaller parts
# Where answers to the bit are promised: a right answer in other bits is right, too.
CLIPPED = {"clip": "true", "builder": "spatial", "insertion": "exact"}


def sets_of(points, facts):
    """Ray sets that are timed: aimed ones where errors are scored, diffuse ones where speed alone counts."""
    exact = {p.must_be_exact for p in points}
    sets = ["camera", "random", *(["diffuse"] if True in exact else []), *(["aimed"] if False in exact else [])]
    return [s for s in sets if s != "aimed" or facts["triangles"]]


def case_seconds(count, sets, seconds):
    """What each case may take. Throws RunError where that is too little."""
    cases = count * (len(sets) + 1)
    if seconds < FEWEST_SECONDS * cases:
        raise RunError(
            f"--seconds: {count} structures on {len(sets)} ray sets take at least {FEWEST_SECONDS * cases:.2g} s of timing; "
            "give more, or fewer --knobs"
        )
    return min(0.5, seconds / cases)


def measure(program, scene, points, structures, facts, settings, seconds, work):
    """Rows of tradeoff.csv. Throws RunError."""
    specs = _distinct(points, structures)
    names = ",".join(specs.values())
    sets = sets_of(points, facts)
    each = case_seconds(len(specs), sets, seconds)
    run, verified = work / "run", work / "verify"
    rays = _run(program, scene, names, sets, settings, each, run, f"speed of {len(specs)} structures")
    cases = read_table(run / "cases.csv")
    judged = ["random", *(AIMED if facts["triangles"] else ())]
    program.run(
        "verify", scene, "--structures", names, "--sets", ",".join(judged), "--rays", settings.verify_rays, "--seed",
        settings.seed, "--out", verified, allowed=(0, 1, 3), phase=f"errors of {len(specs)} structures",
    )  # fmt: skip
    verdicts = read_table(verified / "verdicts.csv")
    rows = _rows(scene, points, structures, cases, verdicts, sets)
    for row in rows:
        _set_commands(row, program, scene, settings, rays)
    _refuse(rows, verdicts)
    _compare(rows)
    return rows


def _run(program, scene, names, sets, settings, each, folder, phase):
    """Times all structures on the very same rays; how many. `raybench run` times what is slow on a part of its rays, which
    caches and predictors of branches favour the more the smaller it is. So few rays are timed first, and then as many as
    the slowest can do; where that was too many, all are timed again."""

    def measure(rays, how, *more):
        program.run(
            "run", scene, "--structures", names, "--sets", ",".join(sets), *_numbers(settings, rays), *more, "--no-report",
            "--out", folder, allowed=(0, 1), phase=f"{phase}, {how}",
        )  # fmt: skip

    rays = settings.rays
    if rays > FEWEST_RAYS:
        measure(FEWEST_RAYS, "a first look", "--budget", FEWEST_SECONDS, "--repetitions", 1)
        rays = min(rays, _affordable(folder, settings, each))
    while True:
        shutil.rmtree(folder, ignore_errors=True)
        measure(rays, f"{rays:,} rays a set", "--budget", f"{each:.4g}", "--repetitions", settings.repetitions)
        cases = _timed(folder)
        if (cases["timed_rays"] == cases["rays"]).all() or rays <= FEWEST_RAYS:
            return rays
        rays = max(FEWEST_RAYS, min(_affordable(folder, settings, each), rays // 2))


def _timed(folder):
    cases = read_table(folder / "cases.csv")
    return cases[(cases["query"] != "build") & (cases["status"] == "timed")]


def _affordable(folder, settings, each):
    """The rays, a power of two, that the slowest structure of an earlier run can do in each sample."""
    slowest = _timed(folder)["median_ns"].max() * 1e-9
    if not slowest > 0:  # none was timed
        return settings.rays
    return max(FEWEST_RAYS, int(2 ** np.floor(np.log2(SAFE * each / (2 * settings.repetitions * slowest)))))


def _numbers(settings, rays):
    """Words of the options that runs of one point and of all have in common."""
    return ["--rays", rays, "--verify-rays", min(rays, 1024), "--seed", settings.seed, "--threads", 1]


def _distinct(points, structures):
    """{full parameters: spec} of the points, Embree first, since it is the anchor."""
    specs = {}
    for point in sorted(points, key=lambda p: p.spec != "embree"):
        specs.setdefault(structures.full(point.spec), point.spec)
    if "embree" in structures.names:
        specs = {structures.full("embree"): "embree"} | specs
    return specs


def _key(case):
    """As Structures.full() of a row that raybench wrote."""
    values = [pair.partition("=") for pair in case.params.split(",") if pair]
    return case.structure, tuple(sorted((k, knobs.normal(v)) for k, _, v in values))


def _rows(scene, points, structures, cases, verdicts, sets):
    by_key = {}
    for case in cases.itertuples():
        by_key.setdefault(_key(case), []).append(case)
    judged = {}
    for row in verdicts.itertuples():
        if row.query == "closest":
            judged.setdefault((_key(row), "aimed" if row.ray_set in AIMED else row.ray_set), []).append(row)
    whole = {c.ray_set: c.median_ns for c in cases.itertuples() if c.spec == c.anchor and c.status == "timed"}
    rows = []
    for point in points:
        key = structures.full(point.spec)
        found = by_key.get(key, [])
        builds = [c for c in found if c.query == "build" and c.threads == 1]
        for ray_set in sets:
            case = next((c for c in found if c.ray_set == ray_set and c.order != "shuffled"), None)
            if case is not None:
                rows.append(_row(scene, point, case, builds[0] if builds else None, judged.get((key, ray_set)), whole))
    return rows


def _row(scene, point, case, build, verdicts, whole):
    row = {
        "scene": scene, "knob": point.knob, "point": point.label, "must_be_exact": int(point.must_be_exact),
        "status": "measured" if case.status == "timed" else case.status, "note": case.note, "spec": case.spec,
        "params": case.params, "claim": case.claim, "ray_set": case.ray_set, "query": case.query,
        "hits_digest": case.hits_digest, "primitives": case.primitives,
        "memory_bytes": case.node_bytes + case.prim_bytes, "samples": case.samples,
    }  # fmt: skip
    judged = verdicts or ([case] if case.verified == case.verified else [])
    row |= _errors(judged, "rays" if verdicts else "verified")
    if case.status == "timed":
        # what the rays timed cost the anchor, against all rays
        part = case.anchor_ns / whole[case.ray_set] if case.ray_set in whole and case.anchor_ns > 0 else 1.0
        for column, ns in (("speed", case.median_ns), ("speed_lo", case.hi_ns), ("speed_hi", case.lo_ns)):
            row[column] = 1e3 * part / ns
    if build is not None and build.status == "timed":
        row |= {"build_ms": build.median_ns / 1e6, "build_lo": build.lo_ns / 1e6, "build_hi": build.hi_ns / 1e6}
    return row


def _errors(judged, counted_as):
    """Counts, rates and intervals over the rows of one or several sets; of t the larger error."""
    n = int(sum(getattr(r, counted_as) for r in judged))
    if not n:
        return {}
    count = {name: int(sum(getattr(r, name) for r in judged)) for name in ERRORS}
    found = {"rays": n} | count | {f"{name}_rate": count[name] / n for name in ERRORS}
    for name, many in (("leak", count["leak"]), ("error", sum(count.values()))):
        found[f"{name}_rate"] = many / n
        found[f"{name}_lo"], found[f"{name}_hi"] = rate_interval(many, n)
    for name in ("t_error_p50", "t_error_p99", "t_error_max"):
        values = [v for r in judged if (v := getattr(r, name)) == v]
        found[name] = max(values) if values else np.nan
    return found


def _set_commands(row, program, scene, settings, rays):
    spec = row["spec"]
    names = spec if spec == "embree" else f"embree,{spec}"
    row["command"] = program.shown(
        "run",
        scene,
        "--structures",
        names,
        "--sets",
        row["ray_set"],
        *_numbers(settings, rays),
        "--no-report",
        "--out",
        "point",
    )
    sets = ",".join(AIMED) if row["ray_set"] == "aimed" else row["ray_set"]
    if row["ray_set"] not in ("random", "aimed"):
        row["error_command"] = row["command"]
    else:
        row["error_command"] = program.shown(
            "verify",
            scene,
            "--structures",
            spec,
            "--sets",
            sets,
            "--rays",
            settings.verify_rays,
            "--seed",
            settings.seed,
        )


def _refuse(rows, verdicts):
    """What broke its claim among the rays that were judged, though not among those of the run, has no speed either."""
    broken = verdicts[verdicts["held"] == 0]
    for row in rows:
        sets = broken.loc[broken["spec"] == row["spec"], "ray_set"]
        if len(sets) and row["status"] == "measured":
            row |= {
                "status": "refused",
                "note": f"claims {row['claim']}, broken on the rays {', '.join(sets.unique())}",
            }
            row |= dict.fromkeys(("speed", "speed_lo", "speed_hi"), np.nan)


def _compare(rows):
    """Marks points that must be exact and answer differently from their knob's first one on the same rays."""
    first = {}
    for row in rows:
        if not row["must_be_exact"] or row["status"] != "measured":
            continue
        if row["claim"] not in ("watertight", "exact"):
            row["must_be_exact"] = 0  # an inexact structure has promised nothing
            continue
        base = first.setdefault((row["knob"], row["ray_set"]), row)
        if row["hits_digest"] == base["hits_digest"]:
            continue
        if _may_differ(row) or _may_differ(base):
            row["note"] = f"other bits than {base['spec']}, as where primitives are cut; judged right"
            continue
        row["status"] = "disagrees"
        row["note"] = f"other answers than {base['spec']} on the {row['ray_set']} rays"


def _may_differ(row):
    """Answers equal to the bit are promised where primitives are inserted by their bounds, and of exact arithmetic."""
    values = dict(pair.partition("=")[::2] for pair in row["params"].split(",") if pair)
    clipped = any(values.get(k) == v for k, v in CLIPPED.items()) or row["spec"].startswith("bvh_spatial")
    return clipped and row["claim"] != "exact"
