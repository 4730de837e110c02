"""Measures how often `raybench check --run` is wrong on this machine: false alarms of a program against itself, and
how often planted slowdowns are found. reports/DECISIONS.md has the figures and how to get them again.

    decision_power.py record --binary build/release/raybench --plugin DELAYED.so --out DIR --hours 1
    decision_power.py report DIR

`record` appends one line a pair to DIR/pairs.jsonl, so that it can be stopped at any time and goes on where it was; it
may run several times at once, with other --out, pinned by taskset. Pairs of a program with itself (aa), with one whose
structure `delayed` is 5 % slower (5) and with one 10 % slower (10) alternate at random. Every third block of pairs runs
beside a process that does nothing but compute, if --busy says so. `report` cuts the pairs of each kind into segments
that share none, lets each be decided by the rule of `raybench check` with its looks, and by two others:
a fixed threshold of 5 % on the ratio of medians, and Mann and Whitney's U test as Google Benchmark's tools/compare.py
has it (two-sided, 0.05), which alarms where some p is below and the median of B is larger. Pairs of a program with itself
are judged once more with the times of `delayed` in B multiplied by 1.05 and 1.10: the noise is real, the slowdown exact.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "reports"))

from raybench_report.decide import decision, pairs, samples  # noqa: E402

KINDS = {"aa": 0.0, "5": 0.05, "10": 0.10}
RUN = (
    "run sphereflake(depth=1) --structures delayed,bvh_sah,bvh_median,embree --quick --rays 1K --verify-rays 64 "
    "--threads 1 --budget 0.001 --repetitions 7 --benchmark_filter=-build"
)
ANCHOR = "embree"
BLOCK = 30  # pairs between changes of load


def record(arguments):
    """Appends pairs until the time is over."""
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    binary, plugin = arguments.binary.resolve(), arguments.plugin.resolve()
    words = RUN.split()
    command = [str(binary), words[0], words[1], "--plugin", str(plugin), *words[2:]]
    programs = {}
    for kind, delay in KINDS.items():
        quoted = " ".join(f"'{word}'" for word in ["env", f"RAYBENCH_TEST_DELAY={delay}", *command])
        programs[kind] = pairs.Program(quoted, out / f"judged-{kind}")
        if programs[kind].folder.exists():
            programs[kind].again = True
        else:
            programs[kind].judge()
    done = sum(1 for _ in open(out / "pairs.jsonl", encoding="utf-8")) if (out / "pairs.jsonl").exists() else 0
    drawn = random.Random(f"{arguments.seed} {done}")
    end = time.monotonic() + 3600 * arguments.hours
    busy = None
    try:
        while time.monotonic() < end:
            loaded = arguments.busy and done // BLOCK % 3 == 2
            if loaded and busy is None:
                busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            if not loaded and busy is not None:
                busy = stop(busy)
            kind = drawn.choices(list(KINDS), [arguments.share, (1 - arguments.share) / 2, (1 - arguments.share) / 2])[
                0
            ]
            a_first = drawn.random() < 0.5
            order = ["aa", kind] if a_first else [kind, "aa"]
            begin, load = time.monotonic(), os.getloadavg()[0]
            times = [programs[k].measure(out / f"run-{i}") for i, k in enumerate(order)]
            a, b = times if a_first else times[::-1]
            line = {
                "kind": kind, "a_first": a_first, "busy": loaded, "load": load,
                "seconds": round(time.monotonic() - begin, 3), "a": to_list(a), "b": to_list(b),
            }  # fmt: skip
            with open(out / "pairs.jsonl", "a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            done += 1
    finally:
        if busy is not None:
            stop(busy)


def stop(process):
    process.send_signal(signal.SIGKILL)
    process.wait()


def to_list(times):
    return [[c.scene, c.spec, c.ray_set, c.order, c.query, c.threads, ns] for c, ns in sorted(times.ns.items())]


def to_times(rows):
    ns = {samples.Comparison(*row[:-1]): row[-1] for row in rows}
    return samples.Times(ns, dict.fromkeys(ns))


def read(folders):
    """{kind: streams}, one stream a folder and state of load, each a list of lines."""
    found = {kind: [] for kind in KINDS}
    for folder in folders:
        lines = [json.loads(line) for line in open(folder / "pairs.jsonl", encoding="utf-8")]
        for kind in KINDS:
            for busy in (False, True):
                stream = [line for line in lines if line["kind"] == kind and line["busy"] == busy]
                if stream:
                    found[kind].append(stream)
    return found


def slowed(times, factor):
    """The same with structure `delayed` slower."""
    return samples.Times({c: ns * (factor if c.spec == "delayed" else 1) for c, ns in times.ns.items()}, times.rays)


def judge(lines, anchor, factor=1.0):
    """What the three rules say of one segment: (verdict, pairs used) of ours, alarm of the threshold, of the U test, and
    whether something fails that was not slowed."""
    stream = pairs.Stream()
    for line in lines:
        stream.add(to_times(line["a"]), slowed(to_times(line["b"]), factor), line["a_first"])
    ratios = stream.ratios(anchor)
    tolerances = np.full(len(ratios.comparisons), np.log1p(0.02))
    look = decision.decide(ratios.log_ratios, tolerances)
    raw = [(a.relative_to(anchor), b.relative_to(anchor)) if anchor else (a, b) for a, b in stream.times]
    a = np.array([[pair[0].ns[c] for pair in raw] for c in raw[0][0].ns])
    b = np.array([[pair[1].ns[c] for pair in raw] for c in raw[0][0].ns])
    threshold = bool((np.median(b, axis=1) / np.median(a, axis=1) > 1.05).any())
    p = stats.mannwhitneyu(a, b, axis=1, alternative="two-sided").pvalue
    u_test = bool(((p < 0.05) & (np.median(b, axis=1) > np.median(a, axis=1))).any())
    failed = [c for c, verdict in zip(ratios.comparisons, look.verdicts) if verdict == decision.FAIL]
    return look.verdict, look.pairs, threshold, u_test, any(c.spec != "delayed" for c in failed)


def report(arguments):
    """Markdown tables, one with the anchor and one without."""
    streams = read(arguments.folders)
    everything = [line for kind in streams.values() for stream in kind for line in stream]
    loads = [line["load"] for line in everything]
    seconds = [line["seconds"] for line in everything]
    print(f"{len(everything)} pairs, {np.median(seconds):.2f} s a pair (median); load average {min(loads):.1f} to "
          f"{max(loads):.1f}, median {np.median(loads):.1f}; decisions of at most {arguments.pairs} pairs\n")  # fmt: skip
    planted = [("itself", "aa", 1.0), ("5 % slower", "5", 1.0), ("10 % slower", "10", 1.0),
               ("itself, times x 1.05", "aa", 1.05), ("itself, times x 1.10", "aa", 1.10)]  # fmt: skip
    for anchor in (ANCHOR, None):
        print(f"Times {'as ratios to ' + anchor if anchor else 'as they are'}:\n")
        print(
            "| program B | decisions | fail | inconclusive | pass | fails of others | pairs | threshold alarms | U test alarms |"
        )
        print("|---|---|---|---|---|---|---|---|---|")
        for name, kind, factor in planted:
            judged = [
                judge(stream[i : i + arguments.pairs], anchor, factor)
                for stream in streams[kind]
                for i in range(0, len(stream) - arguments.pairs + 1, arguments.pairs)
            ]
            if not judged:
                continue
            verdicts = [j[0] for j in judged]
            counts = [verdicts.count(v) for v in (decision.FAIL, decision.INCONCLUSIVE, decision.PASS)]
            print(f"| {name} | {len(judged)} | {' | '.join(map(str, counts))} | {sum(j[4] for j in judged)} | "
                  f"{np.mean([j[1] for j in judged]):.0f} | {sum(j[2] for j in judged)} | {sum(j[3] for j in judged)} |")  # fmt: skip
        print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    recorder = commands.add_parser("record", help="append pairs to DIR/pairs.jsonl")
    recorder.add_argument("--binary", type=Path, required=True, help="raybench")
    recorder.add_argument("--plugin", type=Path, required=True, help="tests/plugins/delayed.cpp, built")
    recorder.add_argument("--out", type=Path, required=True)
    recorder.add_argument("--hours", type=float, default=1)
    recorder.add_argument("--share", type=float, default=0.6, help="of pairs of the program with itself")
    recorder.add_argument("--busy", action="store_true", help="a busy process beside every third block")
    recorder.add_argument("--seed", type=int, default=1)
    recorder.set_defaults(act=record)
    reporter = commands.add_parser("report", help="decide segments of the recorded pairs")
    reporter.add_argument("folders", type=Path, nargs="+")
    reporter.add_argument("--pairs", type=int, default=30, help="of a decision, at most; default 30")
    reporter.set_defaults(act=report)
    arguments = parser.parse_args()
    arguments.act(arguments)


if __name__ == "__main__":
    main()
