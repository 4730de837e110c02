"""Made-up runs for the tests of the reports."""

import csv
import json
import random

from raybench_report import columns, results

CASES, SAMPLES = ([name for name, *_ in columns.columns_of(table)] for table in ("cases.csv", "samples.csv"))
RAY_SETS = [("camera", "closest"), ("shadow.0", "any"), ("reflection.1", "closest"), ("random", "closest")]
SPECS = {
    # ns per ray and per primitive built, steps and primitive tests per ray, share of leaks
    "null": (1.5, 0.01, 0, 0, None),
    "brute": (4e5, 2, 1, 6e4, 0),
    "bvh_sah": (400, 90, 30, 5, 0),
    "grid": (900, 20, 12, 60, 0),
    "bvh_sah(numerics=fast)": (370, 90, 30, 5, 0.0004),
    "embree": (150, 60, None, None, 0.0001),
    "embree(robust=true)": (165, 60, None, None, 0),
}


def case(spec, scene, ray_set, query, noise, threads=1, **changes):
    """One row of cases.csv, as a dictionary of texts."""
    ns, build_ns, steps, prims, leaks = SPECS[spec]
    primitives, rays = 66450, 1 << 20
    median = (build_ns * primitives / threads if query == "build" else ns) * noise.uniform(0.6, 1.6)
    row = dict.fromkeys(CASES, "")
    row |= {
        "case_id": f"{noise.getrandbits(64):016x}", "scene": scene, "scene_hash": "00ff", "primitives": primitives,
        "structure": spec.partition("(")[0], "spec": spec, "params": "", "ray_set": ray_set, "query": query,
        "threads": threads, "seed": 1, "status": "timed", "claim": "nothing" if spec == "null" else "watertight",
        "node_bytes": 0 if spec in ("null", "brute") else 32 * primitives,
        "prim_bytes": 48 * primitives if spec == "bvh_sah" else 0,
        "needs_geometry": 0 if spec in ("null", "bvh_sah") else 1, "build_peak_bytes": 90 * primitives,
        "samples": 9, "median_ns": median, "lo_ns": median * 0.97, "hi_ns": median * 1.04,
        "rate": 1e9 / median * (primitives if query == "build" else 1),
    }  # fmt: skip
    if query != "build":
        row |= {
            "ray_hash": "0abc",
            "order": "traced",
            "rays": rays,
            "timed_rays": rays,
            "oracle": "cgal",
            "hits": rays // 2,
        }
        row |= dict.fromkeys(results.VERDICTS, 0)
        if leaks is None:
            row |= dict.fromkeys(results.VERDICTS, "")
        else:
            row |= {"verified": 100000, "leak": int(100000 * leaks * noise.uniform(0.5, 2))}
            row |= {"claim": "inexact"} if leaks else {}
            row["exact"] = 100000 - row["leak"]
        if steps is not None:
            row |= {"steps": steps * noise.uniform(0.7, 1.3), "prims": prims * noise.uniform(0.7, 1.3)}
            row["bytes"] = 64 * row["steps"] + 40 * row["prims"]
    return row | changes


def full_run(scenes=("/models/sponza.obj", "sphereflake(depth=5)"), specs=tuple(SPECS), ray_sets=tuple(RAY_SETS)):
    """Rows of a whole run: builds with one and eight threads, queries with one."""
    noise = random.Random(7)
    rows = []
    for scene in scenes:
        for spec in specs:
            rows += [case(spec, scene, "build", "build", noise, threads) for threads in (1, 8)]
            rows += [case(spec, scene, ray_set, query, noise) for ray_set, query in ray_sets]
    return rows


def write_run(directory, rows, **info):
    """Writes cases.csv, samples.csv and run.json of these rows; `info`: more of run.json."""
    directory.mkdir(exist_ok=True, parents=True)
    with open(directory / "cases.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, CASES)
        writer.writeheader()
        writer.writerows(rows)
    with open(directory / "samples.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, SAMPLES, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(sample for row in rows if row["status"] == "timed" for sample in samples_of(row))
    (directory / "run.json").write_text(
        json.dumps({"format": columns.FORMAT, "machine": {"cpu": "<Test & Co>"}, "seed": 1} | info)
    )
    return directory


def samples_of(row):
    """Nine samples around the row's median: 0.96, 0.97, ... 1.04 of it."""
    each = float(row["median_ns"]) * (1 if row["query"] == "build" else float(row["timed_rays"])) / 1e9
    for k in range(9):
        seconds = each * (0.96 + 0.01 * ((5 * k) % 9))
        rays = "" if row["query"] == "build" else row["timed_rays"]
        yield row | {"sample": k, "sequence": k, "passes": 1, "rays": rays, "seconds": seconds, "cpu_seconds": seconds}


def without_time(row, status, note):
    """The row as a case that got no time."""
    return row | {"status": status, "note": note, "median_ns": "", "lo_ns": "", "hi_ns": "", "rate": "", "samples": ""}
