"""Measures how often `raybench check --run` is wrong on this machine: false alarms of a program against itself, and
how often planted slowdowns are found. reports/DECISIONS.md has the figures and how to get them again.

    decision_power.py record --binary build/release/raybench --plugin DELAYED.so --out DIR --hours 1
    decision_power.py report DIR

`record` makes decisions by the code of `raybench check --run`, one after the other, until PLAN is done or the time is
over, and appends each to DIR/decisions.jsonl with all its pairs: so it can be stopped at any time, and goes on where it
was. Each compares a program with itself (aa), or with one whose structure `delayed` is 5 % (5) or 10 % slower (10), in an
order drawn beforehand; every third runs beside a process that does nothing but move memory. Nothing is chosen by what the
times say. `report` counts verdicts, and what two other rules say of the very same times: a fixed threshold of 5 % on the
ratio of medians, and Mann and Whitney's U test as Google Benchmark's tools/compare.py has it (two-sided, 0.05), which
alarm where one case is slower in B.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "reports"))

from raybench_report.decide import decision, pairs, samples  # noqa: E402

PLAN = {"aa": 1000, "5": 200, "10": 200}  # decisions
DELAYS = {"aa": 0.0, "5": 0.05, "10": 0.10}
RUN = (  # 30 cases and 3 summaries; some 0.12 s of CPU time a pair
    "run sphereflake(depth=0,tessellation=3) --structures delayed,bvh_sah,bvh_median --quick --rays 128 --verify-rays 64 "
    "--threads 1 --budget 0.0005 --repetitions 5 --benchmark_filter=-build"
)
BUDGET = pairs.Budget(seconds=60, pairs=20)  # of a decision: one look
TOLERANCE = 0.02
BUSY = (  # ends with its parent, however that ends
    "import os; os.nice(5); parent = os.getppid(); block = bytearray(16 << 20)\n"
    "while os.getppid() == parent: block = bytearray(block)"
)


class Judged(pairs.Program):
    """A program that is judged once, not for each decision anew."""

    def judge(self, like=None):
        if self.folder.exists():
            self.again = True
        else:
            super().judge(like)


def planned(seed):
    """(kind, busy) of all decisions, in their order."""
    kinds = [kind for kind, decisions in PLAN.items() for _ in range(decisions)]
    random.Random(seed).shuffle(kinds)
    return [(kind, number % 3 == 2) for number, kind in enumerate(kinds)]


def record(arguments):
    """Appends decisions until the plan is done or the time is over; one that is cut short by the end is finished."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "decisions.jsonl"
    binary, plugin = arguments.binary.resolve(), arguments.plugin.resolve()
    words = RUN.split()
    command = [str(binary), words[0], words[1], "--plugin", str(plugin), *words[2:]]
    programs = {}
    for kind, delay in DELAYS.items():
        quoted = " ".join(f"'{word}'" for word in ["env", f"RAYBENCH_TEST_DELAY={delay}", *command])
        programs[kind] = Judged(quoted, arguments.out / f"judged-{kind}")
    done = len(read(arguments.out)) if path.exists() else 0
    end = time.monotonic() + 3600 * arguments.hours
    for number, (kind, busy) in enumerate(planned(arguments.seed)):
        if number < done:
            continue
        if time.monotonic() > end:
            break
        beside = subprocess.Popen([sys.executable, "-c", BUSY]) if busy else None
        try:
            begin, load = time.monotonic(), os.getloadavg()[0]
            seed = f"{arguments.seed} {number}"
            stream, _, look = pairs.run(
                [programs["aa"], programs[kind]], lambda _: TOLERANCE, BUDGET, seed, say=lambda _: None
            )
        finally:
            if beside is not None:
                beside.kill()
                beside.wait()
        line = {
            "kind": kind, "busy": busy, "load": load, "seconds": round(time.monotonic() - begin, 3),
            "verdict": look.verdict if look else decision.INCONCLUSIVE,
            "pairs": [[int(a_first), to_list(a), to_list(b)] for (a, b), a_first in zip(stream.times, stream.a_first)],
        }  # fmt: skip
        with open(path, "a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def to_list(times):
    return [[c.scene, c.spec, c.ray_set, c.order, c.query, c.threads, float(f"{ns:.5g}")] for c, ns in times.ns.items()]


def to_times(rows):
    ns = {samples.Comparison(*row[:-1]): row[-1] for row in rows}
    return samples.Times(ns, dict.fromkeys(ns))


def read(folder):
    with open(folder / "decisions.jsonl", encoding="utf-8") as file:
        return [json.loads(line) for line in file]


def arrays(line):
    """(comparisons, times of A, of B) of one decision: a row a comparison, a column a pair."""
    pairs_of = [(to_times(a), to_times(b)) for _, a, b in line["pairs"]]
    comparisons = list(pairs_of[0][0].ns)
    return comparisons, *(np.array([[pair[side].ns[c] for pair in pairs_of] for c in comparisons]) for side in (0, 1))


def verdicts(comparisons, a, b):
    """By the rule of `raybench check`: (comparisons with those of all ray sets together, log-ratios, the last look)."""
    ratios = samples.with_summaries(samples.Ratios(comparisons, np.log(b / a), {}))
    tolerances = np.full(len(ratios.comparisons), np.log1p(TOLERANCE))
    return ratios, decision.decide(ratios.log_ratios, tolerances)


def alarms(a, b):
    """(threshold, U test): whether one case is slower by more than 5 %; whether one is slower, and its p below 0.05."""
    slower = np.median(b, axis=1) / np.median(a, axis=1)
    p = stats.mannwhitneyu(a, b, axis=1, alternative="two-sided").pvalue
    return bool((slower > 1.05).any()), bool(((p < 0.05) & (slower > 1)).any())


def judge(line):
    """What the rules say of one decision: whether a structure fails that was not slowed, both alarms, and the ratio of
    `delayed` over all ray sets."""
    comparisons, a, b = arrays(line)
    ratios, look = verdicts(comparisons, a, b)
    if (look.verdict if look else decision.INCONCLUSIVE) != line["verdict"]:
        sys.exit(f"recorded as {line['verdict']}, now {look.verdict}: the rule has changed")
    others = any(
        c.spec != "delayed" and v == decision.FAIL for c, v in zip(ratios.comparisons, look.verdicts if look else [])
    )
    whole = [i for i, c in enumerate(ratios.comparisons) if c.spec == "delayed" and c.is_summary]
    return others, *alarms(a, b), float(np.exp(np.median(ratios.log_ratios[whole])))


def thrown_again(lines, throws, seed=1):
    """(decisions, fails, alarms of the threshold, of the U test) when the coin that says which process of a pair is A is
    thrown anew, `throws` times for each decision on a program against itself. The noise, and how cases and neighbours in
    time depend on each other, stay what they were."""
    rng, counts = np.random.default_rng(seed), np.zeros(4, dtype=int)
    for line in lines:
        comparisons, a, b = arrays(line)
        for _ in range(throws):
            swap = rng.random(a.shape[1]) < 0.5
            x, y = np.where(swap, b, a), np.where(swap, a, b)
            look = verdicts(comparisons, x, y)[1]
            failed = look is not None and look.verdict == decision.FAIL
            counts += [1, failed, *alarms(x, y)]
    return counts


def report(arguments):
    """A Markdown table: a row for each program B and state of load; then what throwing the coins anew gives."""
    lines = [line for folder in arguments.folders for line in read(folder)]
    loads, seconds = [line["load"] for line in lines], [line["seconds"] for line in lines]
    print(
        f"{len(lines)} decisions, {sum(len(line['pairs']) for line in lines)} pairs; seconds a decision: median "
        f"{np.median(seconds):.1f}, most {max(seconds):.0f}; load average {min(loads):.1f} to {max(loads):.1f}, median "
        f"{np.median(loads):.1f}\n"
    )
    print("| program B | beside a busy process | decisions | fail | inconclusive | pass | fails of others | ratio "
          "| threshold alarms | U test alarms |\n" + "|---" * 10 + "|")  # fmt: skip
    for kind, delay in DELAYS.items():
        for busy in (False, True):
            chosen = [line for line in lines if line["kind"] == kind and line["busy"] == busy]
            if not chosen:
                continue
            judged = [judge(line) for line in chosen]
            counts = [
                sum(line["verdict"] == v for line in chosen)
                for v in (decision.FAIL, decision.INCONCLUSIVE, decision.PASS)
            ]
            print(f"| {f'{delay:.0%} slower' if delay else 'itself'} | {'yes' if busy else 'no'} | {len(chosen)} "
                  f"| {' | '.join(map(str, counts))} | {sum(j[0] for j in judged)} | {np.median([j[3] for j in judged]):.3f} "
                  f"| {sum(j[1] for j in judged)} | {sum(j[2] for j in judged)} |")  # fmt: skip
    alike = [line for line in lines if line["kind"] == "aa"]
    print("\nfalse alarms:", bounded(sum(line["verdict"] == decision.FAIL for line in alike), len(alike)))
    if arguments.throws:
        decisions, *found = thrown_again(alike, arguments.throws)
        for rule, count in zip(("raybench check", "threshold", "U test"), found):
            print(f"coins thrown anew, {rule}: {count} of {decisions}, {count / decisions:.3%}")


def bounded(count, of):
    highest = stats.binomtest(count, of).proportion_ci(0.90, method="exact").high
    return f"{count} of {of}, at most {highest:.2%} (95 %, one-sided)"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    recorder = commands.add_parser("record", help="append decisions to DIR/decisions.jsonl")
    recorder.add_argument("--binary", type=Path, required=True, help="raybench")
    recorder.add_argument("--plugin", type=Path, required=True, help="tests/plugins/delayed.cpp, built")
    recorder.add_argument("--out", type=Path, required=True)
    recorder.add_argument("--hours", type=float, default=1)
    recorder.add_argument("--seed", type=int, default=1)
    recorder.set_defaults(act=record)
    reporter = commands.add_parser("report", help="count verdicts")
    reporter.add_argument("folders", type=Path, nargs="+")
    reporter.add_argument(
        "--throws",
        type=int,
        default=0,
        help="decide each decision on a program against itself so often again, with new coins",
    )
    reporter.set_defaults(act=report)
    arguments = parser.parse_args()
    arguments.act(arguments)


if __name__ == "__main__":
    main()
