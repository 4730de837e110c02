"""Runs two programs by turns, pair by pair, until all is decided."""

import csv
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import results
from . import decision, samples, statistics

SIDES = ("A", "B")


@dataclass
class Stream:
    """Pairs as they come: times of both sides, and whether A ran first. `each`: seconds that one took."""

    times: list = field(default_factory=list)
    a_first: list = field(default_factory=list)
    each: float = 0.0

    def add(self, a, b, a_first):
        self.times.append((a, b))
        self.a_first.append(bool(a_first))

    def ratios(self, anchor=None):
        pairs = self.times
        if anchor:
            pairs = [(a.relative_to(anchor), b.relative_to(anchor)) for a, b in pairs]
            if not pairs[0][0].ns:
                raise results.RunError(f"--anchor {anchor}: no case has a time of it beside the others")
        return samples.ratios_of(pairs)

    def write(self, path):
        """pairs.csv: one row a pair, side and comparison."""
        fields = ["pair", "side", "ran_first", *samples.KEY, "ns", "rays"]

        def write(temporary):
            with open(temporary, "w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(fields)
                for number, (pair, a_first) in enumerate(zip(self.times, self.a_first)):
                    for side, of_side in zip(SIDES, pair):
                        for c, ns in of_side.ns.items():
                            key = [c.scene, c.spec, c.ray_set, c.order, c.query, c.threads]
                            rays = of_side.rays[c]
                            writer.writerow(
                                [
                                    number,
                                    side,
                                    int((side == "A") == a_first),
                                    *key,
                                    repr(ns),
                                    "" if rays is None else rays,
                                ]
                            )

        results.write_atomically(path, write)


def read_stream(path):
    """A pairs.csv again. Throws RunError."""
    stream, pairs = Stream(), {}
    try:
        with open(path, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                sides, first = pairs.setdefault(int(row["pair"]), ({}, {}))
                c = samples.Comparison(*(row[name] for name in samples.KEY[:-1]), int(row["threads"]))
                ns, rays = sides.setdefault(row["side"], ({}, {}))
                ns[c], rays[c] = float(row["ns"]), int(row["rays"]) if row["rays"] else None
                first[row["side"]] = row["ran_first"] == "1"
        for number in sorted(pairs):
            sides, first = pairs[number]
            stream.add(samples.Times(*sides["A"]), samples.Times(*sides["B"]), first["A"])
    except (OSError, KeyError, ValueError) as error:
        raise results.RunError(f"{path}: not a file of pairs: {error}") from None
    return stream


@dataclass
class Program:
    """One side: a command line of `raybench run` or of what takes the same arguments."""

    command: str
    folder: Path  # of its judged run
    again: bool = False  # knows --again

    def words(self, *more):
        return [*shlex.split(self.command), *more]

    def judge(self, like=None):
        """The first run, with verdicts and counters; each case is timed on the part of its rays that the program `like`
        timed, else B may choose another one, and nothing could be compared."""
        knows = _output(self.words("--help"))
        self.again = "--again" in knows
        more = ["--keep-rays"] if self.again else []
        if like and "--parts-of" in knows:
            more += ["--parts-of", str(like.folder)]
        _run(self.words("--no-report", "--out", str(self.folder), *more))

    def measure(self, folder):
        """One more process. Its Times."""
        more = ["--again", str(self.folder)] if self.again else []
        try:
            _run(self.words("--no-report", "--out", str(folder), *more))
            return samples.times_of(folder)[0]
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _output(words):
    try:
        return subprocess.run(words, capture_output=True, text=True, check=False).stdout
    except OSError as error:
        raise results.RunError(f"{words[0]}: {error.strerror}") from None


def _run(words):
    """1, a broken claim, and 3, no time, are for the decision to see; anything else but 0 ends it."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    except OSError as error:
        raise results.RunError(f"{words[0]}: {error.strerror}") from None
    if done.returncode not in (0, 1, 3):
        said = done.stderr.strip().splitlines() or ["it said nothing"]
        raise results.RunError(f"exit code {done.returncode} of `{shlex.join(words)}`: {said[-1]}")


@dataclass
class Budget:
    seconds: float = 300
    pairs: int = 100000


def run(programs, tolerance_of, budget, seed, anchor=None, until_all=False, say=None):
    """Judges both programs, then runs them by turns. Returns (Stream, Ratios, Look or None).

    Which one goes first is drawn for each pair. Looks are after 20, 30, 45, ... pairs, and once more when the budget
    ends between two of them; a pair is begun only if one as long as those before fits into the budget, and measuring
    ends early where the budget is far too short for a first look.
    """
    say = say or Progress()
    begin = time.monotonic()
    for side, program in zip(SIDES, programs):
        say(f"{side}: judging and counting, once")
        program.judge(programs[0] if side == "B" else None)
    stream, coin = Stream(), random.Random(seed)
    look, number, sizes = None, 0, statistics.look_sizes(decision.FEWEST_PAIRS)
    due, measuring = next(sizes), time.monotonic()

    def take_look():
        ratios = stream.ratios(anchor)
        tolerances = np.log1p([tolerance_of(c) for c in ratios.comparisons])
        return decision.look_at(ratios.log_ratios, tolerances, number) if ratios.comparisons else None

    with tempfile.TemporaryDirectory(prefix="raybench-pair-", dir=_memory()) as scratch:
        while len(stream.times) < budget.pairs:
            done = len(stream.times)
            left = budget.seconds - (time.monotonic() - begin)
            if done and stream.each > left or left <= 0:
                break
            # Then there will be no look: better said now than when all is spent.
            if done >= 3 and (decision.FEWEST_PAIRS - done) * stream.each > 1.5 * left:
                break
            say(_status(stream, look, due, left))
            a_first = coin.random() < 0.5
            order = SIDES if a_first else SIDES[::-1]
            times = {side: programs[SIDES.index(side)].measure(Path(scratch, side)) for side in order}
            stream.add(times["A"], times["B"], a_first)
            stream.each = (time.monotonic() - measuring) / len(stream.times)
            if len(stream.times) < due:
                continue
            number, due = number + 1, next(sizes)
            look = take_look()
            if look is None or decision.is_over(look, until_all):
                break
    if (look is None or look.pairs < len(stream.times)) and len(stream.times) >= decision.FEWEST_PAIRS:
        number += 1
        look = take_look()
    say(None)
    return stream, stream.ratios(anchor) if stream.times else samples.Ratios([], np.empty((0, 0)), {}), look


def _memory():
    """A folder in memory, for the small files of each process: making them on a disk takes a tenth of it. None: the
    system's usual one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _status(stream, look, due, left):
    done = len(stream.times)
    text = f"{done} pairs"
    if look is not None:
        decided = int((look.verdicts != decision.INCONCLUSIVE).sum())
        text += f", {decided} of {look.verdicts.size} comparisons decided"
    if done:
        to_look = (due - done) * stream.each
        when = f"next look in {to_look:.0f} s" if to_look <= left else "no look before the end"
        text += f"; {when}, at most {left:.0f} s left"
    return text


class Progress:
    """On a terminal one line is redrawn; elsewhere a line is printed every 15 seconds at most."""

    def __init__(self, out=None):
        self._out = out or sys.stderr
        self._terminal = self._out.isatty()
        self._last = 0.0

    def __call__(self, text):
        if self._terminal:
            self._out.write("\r\033[K" + (text or ""))
        elif text and time.monotonic() - self._last >= 15:
            self._last = time.monotonic()
            self._out.write(text + "\n")
        self._out.flush()


def facts_of(folder):
    """What the decision takes of run.json."""
    info = results.read_info(folder / "run.json")
    return {name: info.get(name) for name in ("build", "machine", "machine_state", "libraries", "without_effect")}
