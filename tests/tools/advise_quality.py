"""Is `raybench advise` right? Its advice against the best point of an exhaustive grid, on nine scenes and for three
numbers of rays. reports/TUNE.md has the table.

    python3 tests/tools/advise_quality.py build/release/raybench --out advise_quality.csv

Each point of the grid is built nine times and traces all rays of the mix in nine rounds beside an anchor: as many samples
as `raybench run` takes, of an eighth of its rays. The best four points of the grid and the advice are then measured once
more, by turns, on rays that neither has seen; the advice's time is divided by the least of the grid's. Both are timed by
the processor time of all that they start.
"""

import argparse
import csv
import json
import math
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "reports"))

from raybench_report.decide.statistics import bootstrap_interval  # noqa: E402
from raybench_report.trade.trials import Trials  # noqa: E402

# Those after the first three were not looked at while advise was written.
SCENES = ["stadium", "bunny", "soup", "sponza", "engine", "terrain", "bush", "fibres", "railing"]
RAYS = [10**4, 10**6, 10**8]
GRID = [
    *[
        f"bvh_wide(builder={builder},width={width},reinsertion={passes})"
        for builder in ("binned", "sweep", "spatial", "morton")
        for width in (8, 16)
        for passes in (0, 2)
    ],
    "bvh_wide(width=4,leaf_size=4)", "bvh_wide(leaf_size=4)", "bvh_wide(bins=8)", "bvh_wide(bins=64)",
    "bvh_wide(nodes=quantized8)", "bvh_wide(nodes=quantized16)", "bvh_wide(builder=spatial,split_budget=3)",
    "bvh_wide(traversal_cost=2)", "bvh_sah", "bvh_sah(bins=8)", "bvh_sah(leaf_size=4)", "bvh_sah(reinsertion=2)",
    "bvh_sweep", "bvh_sweep(reinsertion=2)", "bvh_spatial", "bvh_spatial(reinsertion=2)", "bvh_morton",
    "bvh_morton(reinsertion=2)", "bvh_ploc", "bvh_median", "kdtree_sah", "kdtree_sah(builder=binned)",
    "kdtree_sah(traversal_cost=4)", "kdtree_spatial_median", "kdtree_object_median", "grid(density=0.1)", "grid",
    "grid(density=8)", "grid_recursive", "octree", "octree(leaf_size=16)", "quadtree", "kdop", "bvh_sphere",
]  # fmt: skip
BUILDS, ROUNDS, BEST, PAIRS = 9, 9, 4, 21
ANCHOR = "bvh_wide"


def processor_seconds():
    """Of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def exhaustive(program, scene, seed):
    """{spec: (build seconds, nanoseconds a ray)} and the processor time that it took."""
    begin = processor_seconds()
    found, anchors = {}, []
    with Trials(program, scene, seed=seed) as trials:
        anchor = trials.build(ANCHOR).tree
        rays = trials.training_rays
        for spec in GRID:
            builds = [trials.build(spec) for _ in range(BUILDS)]
            if builds[0].tree is None:
                continue
            trials.drop(*[b.tree for b in builds[1:]])
            ns = trials.time([anchor, builds[0].tree], rays, ROUNDS + 1)[:, 1:]
            anchors.append(np.median(ns[0]))
            found[spec] = (min(b.seconds for b in builds), float(np.median(ns[1] / ns[0])))
            trials.drop(builds[0].tree)
    unit = float(np.median(anchors))
    return {spec: (build, ratio * unit) for spec, (build, ratio) in found.items()}, processor_seconds() - begin


def advised(program, scene, rays, seed):
    begin = processor_seconds()
    words = [program, "advise", scene, "--rays", str(rays), "--json", "--no-offset", "--seed", str(seed)]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout), processor_seconds() - begin


def compare(program, scene, specs, rays, seed):
    """Total seconds of each, a row each and a column for each round, on rays held out. Trees are built anew each round, or
    each seventh where building is less than 1 % of the total."""
    totals, random, built = [], np.random.default_rng(seed), []
    with Trials(program, scene, seed=seed) as trials:
        for i in range(PAIRS + 1):
            if not built or i % 7 == 0 or any(b.seconds > 0.01 * t for b, t in zip(built, totals[-1])):
                trials.drop(*[b.tree for b in built])
                built = [None] * len(specs)
                for k in random.permutation(len(specs)):  # the first to be built finds another state of the memory
                    built[k] = trials.build(specs[k])
            ns = trials.time([b.tree for b in built], trials.held_out_rays, 2, held_out=True)[:, 1]
            totals.append([b.seconds + rays * 1e-9 * t for b, t in zip(built, ns)])
    return np.array(totals[1:]).T


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--rays", nargs="+", type=int, default=RAYS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    rows = []
    print("| scene | rays | advice | best of the grid | advice / best | 95 % | advise s / grid s |\n|" + "---|" * 7)
    for scene in arguments.scenes:
        grid, grid_seconds = exhaustive(arguments.program, scene, arguments.seed)
        for rays in arguments.rays:
            advice, seconds = advised(arguments.program, scene, rays, arguments.seed)
            spec = advice["advice"]["structure"]
            best = sorted(grid, key=lambda s: grid[s][0] + rays * 1e-9 * grid[s][1])[:BEST]
            totals = compare(arguments.program, scene, [spec, *best], rays, arguments.seed)
            least = 1 + int(np.argmin(np.median(totals[1:], axis=1)))
            ratios = np.log(totals[0] / totals[least])
            lo, hi = (math.exp(x[0]) for x in bootstrap_interval(ratios))
            ratio = math.exp(np.median(ratios))
            rows.append([scene, rays, spec, best[least - 1], ratio, lo, hi, seconds, grid_seconds, len(grid)])
            print(
                f"| {scene} | {rays:.0e} | {spec} | {best[least - 1]} | {ratio:.3f} | {lo:.3f} to {hi:.3f} "
                f"| {seconds:.1f} / {grid_seconds:.1f} |",
                flush=True,
            )
    ratios, parts = [row[4] for row in rows], [row[7] / row[8] for row in rows]
    print(f"\nadvice / best: median {np.median(ratios):.3f}, worst {max(ratios):.3f}", end="; ")
    print(f"advise / grid of {len(GRID)} points: median {np.median(parts):.3f}, worst {max(parts):.3f}")
    if arguments.out:
        names = "scene,rays,advice,best,ratio,lo,hi,advise_seconds,grid_seconds,points".split(",")
        with open(arguments.out, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([names, *rows])


if __name__ == "__main__":
    main()
