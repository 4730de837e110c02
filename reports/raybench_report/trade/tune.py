"""`raybench tune`: parameters of a structure for a scene and a mix of rays, by Optuna's tree-structured Parzen estimator
(Akiba and others 2019: Optuna; Bergstra and others 2011: Algorithms for hyper-parameter optimization).

A point is built and traced beside an anchor that never changes, so that a machine which becomes slower for a while does
not make the point look slow. Half of the rays are used to choose, the other half to compare the choice with the default.
"""

import argparse
import csv
import json
import math
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..decide.statistics import bootstrap_interval
from ..errors import RunError
from . import space
from .files import require_folder, table, toml, write_file
from .trials import Trials, TrialsEnded

ANCHOR = "bvh_sah"
HOPELESS = 3.0  # a point that costs so many times the best one is not measured any better
SLOW_BUILD = 50.0  # a build that takes so many times the default's, and a second, is given up
FINALISTS = 4  # of the search, measured once more before one is chosen
ROUNDS = 15  # of the comparison with the default


def main(argv):
    """Returns the exit code. Throws RunError for wrong input."""
    arguments = _parser().parse_args(argv)
    require_folder(arguments.out)
    try:
        import optuna
    except ImportError:
        raise RunError("tune needs Optuna; `pip install -r reports/requirements.txt`") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    spec = space.Spec.parse(arguments.structure)
    described = space.describe(arguments.program, spec.name, arguments.plugin)
    parameters = space.tunable(described, spec)
    if not parameters:
        raise RunError(f"{arguments.structure} has no parameter to tune: none is left that does not change answers")
    try:
        with Trials(
            arguments.program, arguments.scene, mix=arguments.mix, seed=arguments.seed, plugins=arguments.plugin
        ) as trials:
            found = _Search(arguments, spec, parameters, trials).run(optuna)
    except TrialsEnded as ended:
        return ended.code
    print(text(found), end="")
    if arguments.out:
        write(arguments.out, found)
        print(f"written {arguments.out / 'tuned.toml'}: raybench run --params takes it")
    return 0


def _parser():
    parser = argparse.ArgumentParser(prog="raybench tune", allow_abbrev=False)
    parser.add_argument("scene")
    parser.add_argument("--program", required=True)
    parser.add_argument("--plugin", action="append", default=[])
    parser.add_argument("--structure", required=True)
    parser.add_argument("--mix", default="picture")
    parser.add_argument("--rays", type=int, default=1000000)
    parser.add_argument("--objective", choices=["total", "trace"], default="total")
    parser.add_argument("--evaluations", type=int, default=60)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    return parser


@dataclass
class Point:
    """One evaluation."""

    values: dict  # that differ from the defaults
    build: float = math.inf  # seconds
    ray: float = math.inf  # nanoseconds, of the mix
    bytes: int = 0
    drift: float = 1.0  # the anchor's time now over that beside the first point; both times are divided by it
    why: str = ""  # it was given up

    def cost(self, rays, objective):
        """Seconds of building and tracing, or of tracing alone."""
        return self.ray * 1e-9 * rays + (self.build if objective == "total" else 0.0)


class _Search:
    def __init__(self, arguments, spec, parameters, trials):
        self._arguments, self._spec, self._parameters, self._trials = arguments, spec, parameters, trials
        self._points, self._random = [], np.random.default_rng(arguments.seed)
        self._rays = min(trials.training_rays, 1 << 14)
        self._progress = _Progress(arguments)

    def run(self, optuna):
        self._anchor = self._trials.build(ANCHOR).tree
        self._anchor_ns = None  # beside the first point that is measured with all rays
        sampler = optuna.samplers.TPESampler(seed=self._arguments.seed)
        study = optuna.create_study(sampler=sampler)
        study.enqueue_trial(space.defaults(self._parameters))
        limit = None if self._arguments.seconds else self._arguments.evaluations
        study.optimize(self._evaluate, n_trials=limit, timeout=self._arguments.seconds)
        self._progress.clear()
        if not math.isfinite(self._cost(self._points[0])):
            raise RunError(f"{self._spec.with_values({})} cannot be measured here: {self._points[0].why}")
        return self._result(self._choose())

    def _cost(self, point):
        return point.cost(self._arguments.rays, self._arguments.objective)

    def _evaluate(self, trial):
        values = {p["name"]: space.suggest(trial, p) for p in self._parameters}
        point = self._measure(space.changed(self._parameters, values))
        self._points.append(point)
        best = min(self._cost(p) for p in self._points)
        self._progress.show(len(self._points), best / self._cost(self._points[0]))
        # The search wants a number for what was given up too: the worst that was measured.
        cost = self._cost(point)
        worst = max((c for c in map(self._cost, self._points) if math.isfinite(c)), default=1.0)
        return math.log(cost if math.isfinite(cost) else 2 * worst)

    def _measure(self, changed):
        for point in self._points:
            if point.values == changed:
                return point  # the search came back to it: the same cost, and one evaluation less
        best = min(map(self._cost, self._points), default=math.inf)
        limit = SLOW_BUILD * self._points[0].build + 1 if self._points else 1e9
        if self._arguments.objective == "total":
            limit = min(limit, HOPELESS * best)  # building alone costs more than the best point
        built = self._trials.build(self._spec.with_values(changed), seconds=limit)
        if built.tree is None:
            return Point(changed, why=built.stopped)
        point = Point(changed, build=built.seconds, bytes=built.bytes)
        # A few rays first, as many as are needed to see that a point is hopeless.
        for rays, rounds in ((self._rays // 64, 2), (self._rays // 8, 2), (self._rays, 4)):
            ns = self._trials.time([self._anchor, built.tree], rays, rounds, seconds=1.0)
            last = ns[:, 1:] if ns.shape[1] > 1 else ns  # the first round warms up
            if rays == self._rays:
                anchor = float(np.median(last[0]))
                self._anchor_ns = self._anchor_ns or anchor
                point.drift = anchor / self._anchor_ns
            point.ray = float(np.median(last[1])) / point.drift
            if self._cost(point) > HOPELESS * best or ns.shape[1] < rounds:
                break
        point.build /= point.drift
        self._trials.drop(built.tree)
        return point

    def _choose(self):
        """The best of the finalists, measured once more, by turns: the best of many noisy figures is flattered."""
        seen = {json.dumps(p.values, sort_keys=True): p for p in self._points if math.isfinite(self._cost(p))}
        finalists = sorted(seen.values(), key=self._cost)[:FINALISTS]
        costs = self._compare([self._spec.with_values(p.values) for p in finalists], held_out=False, rounds=7)
        return finalists[int(np.argmin(np.median(costs.total(self._arguments), axis=1)))]

    def _compare(self, specs, held_out, rounds):
        """Builds and traces all by turns, `rounds` times after one that warms up."""
        rays = min(self._trials.held_out_rays if held_out else self._trials.training_rays, self._rays)
        builds, ns, sizes = [], [], []
        for done in range(rounds):
            trees = self._build_all(specs)
            for tree in trees:
                if tree.tree is None:
                    raise RunError(f"{tree.spec}: {tree.stopped}")
            numbers = [tree.tree for tree in trees]
            builds.append([tree.seconds for tree in trees])
            sizes = [tree.bytes for tree in trees]
            ns.append(self._trials.time(numbers, rays, 2, held_out=held_out, seconds=1.0)[:, -1])
            self._trials.drop(*numbers)
            if self._trials.facts["primitives"] * rounds > 5e6 and done >= 6:
                break  # of a large scene fewer pairs say as much
        return Comparison(np.array(builds).T, np.array(ns).T, sizes)

    def _build_all(self, specs):
        """In random order: the first to be built finds another state of the memory than the last."""
        trees = [None] * len(specs)
        for i in self._random.permutation(len(specs)):
            trees[i] = self._trials.build(specs[i])
        return trees

    def _result(self, chosen):
        specs = [self._spec.with_values({}), self._spec.with_values(chosen.values)]
        held_out = None
        if chosen.values:
            held_out = self._compare(specs, held_out=True, rounds=ROUNDS)
        return Found(self._arguments, self._trials.facts, specs[0], specs[1], chosen, self._points, held_out)


@dataclass
class Comparison:
    """Specs by turns: a row each, a column for each round."""

    builds: np.ndarray  # seconds
    ns: np.ndarray  # a ray
    bytes: list

    def total(self, arguments):
        trace = self.ns * 1e-9 * arguments.rays
        return trace + self.builds if arguments.objective == "total" else trace


@dataclass
class Found:
    arguments: argparse.Namespace
    facts: dict
    default: str
    tuned: str
    chosen: Point
    points: list
    held_out: Comparison | None  # default and tuned; none where the default itself is the best

    def gain(self):
        """(median, lo, hi) of the default's cost over the tuned one's on the rays held out, with 95 %."""
        if self.held_out is None:
            return 1.0, 1.0, 1.0
        total = np.log(self.held_out.total(self.arguments))
        ratios = total[0] - total[1]
        lo, hi = bootstrap_interval(ratios)
        return math.exp(np.median(ratios)), math.exp(lo[0]), math.exp(hi[0])


def text(found):
    """What the command prints."""
    arguments, facts = found.arguments, found.facts
    sets = ", ".join(f"{s['set']} {100 * s['share']:.0f} %" for s in facts["sets"])
    what = "tracing" if arguments.objective == "trace" else f"building and tracing {arguments.rays:,} rays"
    lines = [f"{facts['scene']}, {facts['primitives']:,} primitives; rays: {sets}; least time of {what}"]
    if found.held_out is None:
        lines.append(f"none of {len(found.points)} points is better than the default, {found.default}")
        return "\n".join(lines) + "\n"
    h = found.held_out
    rows = [["", "build ms", "ns a ray", "total s", "MB"]]
    for i, spec in enumerate((found.default, found.tuned)):
        total = np.median(h.total(arguments)[i])
        rows.append(
            [spec, f"{1e3 * np.median(h.builds[i]):.1f}", f"{np.median(h.ns[i]):.4g}", f"{total:.4g}"]
            + [f"{h.bytes[i] / 1e6:.1f}"]
        )
    lines += table(rows)
    gain, lo, hi = found.gain()
    known = f"95 % interval {lo:.2f} to {hi:.2f}" if math.isfinite(hi) else "too few rounds for an interval"
    lines.append(f"on held-out rays the default takes {gain:.2f} times as long as the tuned one ({known})")
    if lo <= 1:
        lines.append("so it is not certain that the tuned one is better at all")
    lines.append(f"{len(found.points)} points tried, seed {arguments.seed}")
    return "\n".join(lines) + "\n"


def write(folder, found):
    """tuned.toml, trials.csv (each point in the order of the search) and tune.json."""
    folder.mkdir(parents=True, exist_ok=True)
    arguments, (gain, lo, hi) = found.arguments, found.gain()
    command = f"raybench tune '{arguments.scene}' --structure '{arguments.structure}' --mix {arguments.mix}"
    command += f" --rays {arguments.rays} --objective {arguments.objective} --seed {arguments.seed}"
    comments = [command, f"on held-out rays the default takes {gain:.3f} times as long ({lo:.3f} to {hi:.3f})"]
    write_file(folder / "tuned.toml", toml(found.tuned, comments))
    write_file(
        folder / "tune.json",
        json.dumps(
            {
                "format": 1, "command": command, "scene": found.facts, "default": found.default, "tuned": found.tuned,
                "gain": gain, "gain_lo": _finite(lo), "gain_hi": _finite(hi), "evaluations": len(found.points),
                "rays": arguments.rays, "objective": arguments.objective, "seed": arguments.seed,
            },
            indent=1,
        ) + "\n",
    )  # fmt: skip
    rows = [["structure", "build_s", "ns_per_ray", "bytes", "drift", "cost_s", "stopped"]]
    spec = space.Spec.parse(found.default)
    for p in found.points:
        cost = p.cost(arguments.rays, arguments.objective)
        cells = [_finite(p.build), _finite(p.ray), p.bytes or None, p.drift, _finite(cost)]
        rows.append([spec.with_values(p.values), *("" if c is None else f"{c:.6g}" for c in cells), p.why])
    with tempfile.NamedTemporaryFile("w", dir=folder, delete=False, newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    os.replace(file.name, folder / "trials.csv")


def _finite(x):
    return x if math.isfinite(x) else None


class _Progress:
    """One line on a terminal: points tried, time left, the best so far."""

    def __init__(self, arguments):
        self._arguments, self._begin = arguments, time.monotonic()
        self._terminal = sys.stderr.isatty()

    def show(self, points, best):
        if not self._terminal:
            return
        spent = time.monotonic() - self._begin
        limit = self._arguments.seconds
        left = limit - spent if limit else spent / points * (self._arguments.evaluations - points)
        of = "" if limit else f" of {self._arguments.evaluations}"
        line = f"\r\033[Kpoint {points}{of}, best {best:.2f} of the default's cost, {max(left, 0):.0f} s left"
        print(line, end="", file=sys.stderr, flush=True)

    def clear(self):
        if self._terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
