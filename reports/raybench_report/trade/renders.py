"""Time and error of pictures: each point rendered several times, against a reference."""

import json
import random
import time
from dataclasses import dataclass, replace

import pandas as pd

from ..results import RunError
from . import fronts, images
from .knobs import LEVELS, Point
from .pareto import UNDECIDED, median_interval
from .program import TooSlow

RECURSION, SAMPLING, SHADOWS = ("depth", "contribution"), ("samples", "adaptive", "filter"), ("shadows",)
DEEPEST = 64
FEWEST = 6  # samples, whatever the budget: fewer have no interval, and decide nothing
MOST = 4  # times the samples wanted, of what stays undecided
FEWEST_SECONDS = 0.02  # of timing, a picture
SMALLEST = 48  # pixels a side, however long the reference takes


@dataclass
class Target:
    """A picture to compare with: its command's words, and its file."""

    words: tuple
    path: object
    samples: int = 1  # a pixel

    def read(self):
        return images.read(self.path)


class Studio:
    """Renders pictures of one scene into `work`/pictures."""

    def __init__(self, program, scene, settings, work, say):
        self.program, self.scene, self.settings, self.say = program, scene, settings, say
        self.folder = work / "pictures"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.size = settings.size
        self.notes = []
        self._apart = {}

    def words(self, options, scene=None, size=None):
        """The words of a render command without its --out."""
        width, height = size or self.size
        own = () if "--structure" in options else ("--structure", self.settings.structure)
        return (
            "render",
            scene or self.scene,
            *own,
            "--size",
            f"{width}x{height}",
            "--seed",
            self.settings.seed,
            *options,
        )

    def render(self, words, name, seconds=None, phase="", threads=None):
        """Renders once: (facts, file). Throws RunError, TooSlow."""
        picture, facts = self.folder / f"{name}.exr", self.folder / f"{name}.json"
        more = ("--threads", threads) if threads else ()
        self.program.run(*words, *more, "--out", picture, "--json", facts, seconds=seconds, phase=phase)
        found = json.loads(facts.read_text(encoding="utf-8"))
        facts.unlink()
        return found, picture

    def apart(self, level):
        """How far the scene and a level of detail of it are apart (Hausdorff), in the scene's units."""
        if level not in self._apart:
            words = ("distance", self.scene, level, "--seed", self.settings.seed, "--json")
            self._apart[level] = json.loads(self.program.run(*words, phase=f"distance of {level}"))["hausdorff"]
        return self._apart[level]

    # ---- references ----

    def deep_reference(self):
        """(target, depth): the deepest of 8, 16, 32, 64 that can be had in time, without a cut-off."""
        left, best = self.settings.reference_seconds, None
        for depth in (8, 16, 32, DEEPEST):
            words, begin = self.words(("--depth", depth)), time.monotonic()
            try:
                _, path = self.render(
                    words, f"reference_depth_{depth}", left if best else None, f"reference, depth {depth}"
                )
            except TooSlow:
                self.notes.append(
                    f"depth: the reference is depth {best[1]}, not {DEEPEST}: depth {depth} took longer than the "
                    f"{self.settings.reference_seconds:g} s that were left for it"
                )
                break
            best, left = (Target(words, path), depth), left - (time.monotonic() - begin)
            if left <= 0 and depth < DEEPEST:
                self.notes.append(f"depth: the reference is depth {depth}, not {DEEPEST}: it took all of its time")
                break
        return best

    def many_samples(self, filters):
        """{filter: target}: the most samples a pixel, jittered, with another seed. Pictures become smaller where that takes
        too long."""
        n, small = self.settings.reference_samples, (64, 64)
        facts, path = self.render(self.words(("--samples", 2), size=small), "probe")
        path.unlink()
        cost = facts["seconds"] / (small[0] * small[1] * 4)  # seconds a camera ray
        most = self.settings.reference_seconds / (cost * n * n * len(filters))  # pixels
        if not self.settings.size_given and (shrink := (most / (self.size[0] * self.size[1])) ** 0.5) < 1:
            whole = self.size
            self.size = tuple(min(s, max(SMALLEST, 8 * int(s * shrink / 8))) for s in whole)
            if self.size != whole:
                self.notes.append(
                    f"samples: pictures are {self.size[0]} x {self.size[1]}, so that references of {n * n:,} samples a pixel "
                    f"take about {self.settings.reference_seconds:g} s; --size sets it"
                )
        targets = {}
        for name in filters:
            options = ("--samples", n, "--pattern", "jittered", "--sampling-seed", self.settings.seed + 1000)
            words = self.words((*options, *(("--filter", name) if name != "box" else ())))
            _, path = self.render(words, f"reference_{name}", phase=f"reference, {n * n:,} samples a pixel, {name}")
            targets[name] = Target(words, path, n * n)
        return targets


def check_budget(count, seconds):
    """Throws RunError where so many pictures cannot be timed."""
    if seconds < FEWEST_SECONDS * FEWEST * count:
        raise RunError(
            f"--seconds: {count} pictures, {FEWEST} times each, take at least {FEWEST_SECONDS * FEWEST * count:.2g} s of "
            "timing; give more, or fewer --knobs"
        )


def measure(program, scene, points, settings, seconds, work, say):
    """(rows of tradeoff.csv, notes) of all picture points."""
    check_budget(len(points), seconds)
    rows, notes = [], []
    groups = [[p for p in points if p.knob in knobs] for knobs in (RECURSION, SAMPLING, SHADOWS, LEVELS)]
    for group in filter(None, groups):
        studio = Studio(program, scene, settings, work, say)
        rows += _group(studio, group, seconds * len(group) / len(points))
        notes += studio.notes
    return rows, notes


def _group(studio, points, seconds):
    """Rows of the points that share references."""
    jobs = _jobs(studio, points)
    numbered = {id(job): f"{job['row']['knob']}_{at:02d}" for at, job in enumerate(jobs)}
    for job in jobs:  # once, for the picture
        name = numbered[id(job)]
        studio.say(f"pictures: {job['row']['point']}")
        try:
            facts, path = studio.render(job["words"], name, threads=1)
        except RunError as error:
            if job["row"]["knob"] not in LEVELS:  # not every mesh can be decimated
                raise
            job["row"] |= {"status": "skipped", "note": str(error)}
            continue
        job["times"].append(facts["cpu_seconds"])
        _compare(studio, job, facts, path, name)
        if job["row"]["must_be_exact"] and job["row"]["differing"]:
            job["row"] |= {"status": "disagrees", "note": f"another picture than `{jobs[0]['row']['point']}`"}
    alive = [job for job in jobs if job["row"]["status"] == "measured"]
    _time(studio, alive, seconds)
    _summarize(alive)
    return [job["row"] for job in jobs]


def _jobs(studio, points):
    """A dictionary a point: words of its command, target, row."""
    kind = points[0].knob
    if kind in RECURSION:
        target, deepest = studio.deep_reference()
        targets, base = {"": target}, ("--depth", deepest)
        points = [p for p in points if p.knob != "depth" or p.options[1] < deepest]
        reference = [("depth", f"depth {deepest}", base)]
    elif kind in SAMPLING:
        filters = [p.options[-1] for p in points if p.knob == "filter"]
        targets = studio.many_samples(list(dict.fromkeys(["box", *filters])))
        base, reference = (), []
    else:
        words = studio.words(points[0].options if kind in SHADOWS else ())
        _, path = studio.render(words, f"reference_{kind}", phase="reference")
        targets, base = {"": Target(words, path)}, ()
        reference = [("lod", "all triangles", ())] if kind in LEVELS else []
    jobs = [_job(studio, Point(knob, label, options=options), None, targets[""]) for knob, label, options in reference]
    for point in points:
        options = point.options + (base if point.knob == "contribution" else ())
        target = targets.get(point.options[-1] if point.knob == "filter" else "box", targets.get(""))
        level = f"decimate({studio.scene},{point.scene or point.secondary})"
        try:
            if point.secondary:
                options += ("--secondary-scene", level)
            if point.moved:
                options += ("--self-intersection", "normal-offset", "--self-intersection-size", studio.apart(level))
        except RunError as error:  # told by the picture, too
            studio.notes.append(f"{point.label}: {error}")
            continue
        jobs.append(_job(studio, replace(point, options=options), level if point.scene else None, target))
    return jobs


def _job(studio, point, scene, target):
    words = studio.words(point.options, scene)
    row = {
        "scene": studio.scene, "knob": point.knob, "point": point.label, "must_be_exact": int(point.must_be_exact),
        "status": "measured", "note": "",
        "reference": studio.program.shown(*target.words, "--out", "reference.exr"),
        "command": studio.program.shown(*words, "--threads", 1, "--out", "point.exr", "--json", "point.json"),
    }  # fmt: skip
    row["error_command"] = row["command"]
    return {"words": words, "target": target, "row": row, "times": []}


def _compare(studio, job, facts, path, name):
    picture, reference = images.read(path), job["target"].read()
    shown, difference = studio.folder / f"{name}.png", studio.folder / f"{name}_difference.png"
    images.save(picture, shown)
    images.save_difference(picture, reference, difference)
    as_png = job["target"].path.with_suffix(".png")
    if not as_png.exists():
        images.save(reference, as_png)
    path.unlink()
    job["row"] |= images.measures(picture, reference)
    job["row"] |= {
        "spec": facts["structure"], "primitives": facts["primitives"],
        "memory_bytes": sum(tree["node_bytes"] + tree["prim_bytes"] for tree in (facts, facts.get("secondary")) if tree),
        "picture": f"{studio.folder.name}/{shown.name}", "difference": f"{studio.folder.name}/{difference.name}",
    }  # fmt: skip


def _time(studio, jobs, seconds):
    """More samples of each, in rounds of random order: at least as many as have an interval; as many as wanted while
    `seconds` last; then of those alone whose place on a front is open."""
    rng, begin = random.Random(studio.settings.seed), time.monotonic()
    wanted, done, taken, asked = studio.settings.samples, 1, 0, jobs
    fewest = min(FEWEST, wanted)
    while asked:
        spent = time.monotonic() - begin
        each = spent / taken if taken else 0
        if done >= fewest and spent + each * len(asked) > seconds:
            break
        for at, job in enumerate(rng.sample(asked, len(asked))):
            studio.say(
                f"pictures: sample {done + 1}, {at + 1} of {len(asked)} - "
                + _left(each, len(asked), at, fewest - done, wanted - done, seconds - spent)
            )
            facts, path = studio.render(job["words"], "sample", threads=1)
            path.unlink()
            job["times"].append(facts["cpu_seconds"])
            taken += 1
        done += 1
        if done >= wanted:
            _summarize(jobs)
            asked = _contested(jobs) if done < MOST * wanted else []
    took = time.monotonic() - begin
    if done < wanted or took > 1.5 * seconds:
        studio.notes.append(
            f"{jobs[0]['row']['knob']}: {done} samples a picture, of {wanted} wanted, took {took:.0f} s, where --seconds left "
            f"{seconds:.0f}: more --seconds, fewer --knobs, or a smaller --size"
        )


def _left(each, count, at, fewest, wanted, seconds):
    """How long rounds of `count` samples go on, as text: `fewest` rounds must be, `wanted` ones as `seconds` allow."""
    if not each:
        return "time left known after a round"
    must, may = (each * (count * max(1, rounds) - at) for rounds in (fewest, wanted))
    return f"about {max(must, min(may, seconds)) if wanted > 0 else max(must, seconds):.0f} s left"


def _summarize(jobs):
    for job in jobs:
        row = job["row"]
        row["seconds"], row["seconds_lo"], row["seconds_hi"] = median_interval(job["times"])
        row["samples"] = len(job["times"])


def _contested(jobs):
    """Those whose place on a front is open, and those that they are compared with."""
    rows = pd.DataFrame([job["row"] for job in jobs]).assign(ray_set="")
    names = set()
    for front in fronts.fronts(rows):
        if front.y is fronts.SECONDS:
            open_ = front.rows[front.rows["place"] == UNDECIDED]
            names |= {*open_["point"], *open_["dominated_by"]}
    return [job for job in jobs if job["row"]["point"] in names]
