"""`raybench check`: reads what was typed, decides, says so."""

import argparse
import math
import shutil
import signal
import tempfile
import time
from pathlib import Path


from .. import results
from . import commits, decision, exact, instructions, output, pairs, tolerance, unpaired


def main(argv):
    """Returns the exit code: 0 pass, 1 fail, 3 inconclusive. Throws RunError for wrong input."""
    arguments = _parser().parse_args(argv)
    arguments.tolerances = tolerance.read(arguments.tolerance) if arguments.tolerance else tolerance.Tolerances()
    begin = time.monotonic()
    signal.signal(signal.SIGTERM, _stop)  # a cancelled job of a CI leaves no worktree behind
    if arguments.baseline:
        check, differences = _against_baseline(arguments)
    elif arguments.run or arguments.commits:
        check, differences = _by_pairs(arguments)
    else:
        check, differences = _folders(arguments)
    check["seconds"] = round(time.monotonic() - begin, 3)
    print(output.text(check, differences), end="")
    if arguments.out:
        output.write(arguments.out, check, differences)
    return decision.EXIT_CODE[check["verdict"]]


def _stop(*_):
    raise KeyboardInterrupt


def _parser():
    parser = argparse.ArgumentParser(prog="raybench check", allow_abbrev=False)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--run", nargs=2)
    parser.add_argument("--commits", nargs=2)
    parser.add_argument("--build", default=commits.BUILD)
    parser.add_argument("--binary", default=commits.BINARY)
    parser.add_argument("--anchor")
    parser.add_argument("--seconds", type=float, default=300)
    parser.add_argument("--pairs", type=int, default=100000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--exact-only", action="store_true")
    parser.add_argument("--instructions", action="store_true")
    parser.add_argument("--tolerance", type=Path)
    parser.add_argument("--baseline", type=Path)
    parser.add_argument("--accept")
    parser.add_argument("--out", type=Path)
    return parser


def _need(condition, text):
    if not condition:
        raise results.RunError(f"check: {text}")


def _check(figures, differences, comparisons=(), pairs_seen=0, unit="pairs", undecided=False, notes=()):
    """What check.json has. `undecided`: times were asked for and cannot be decided."""
    verdicts = {row["verdict"] for row in comparisons}
    if differences or decision.FAIL in verdicts:
        verdict = decision.FAIL
    elif undecided or decision.INCONCLUSIVE in verdicts:
        verdict = decision.INCONCLUSIVE
    else:
        verdict = decision.PASS
    if any(d.figure in ("scene_hash", "ray_hash") for d in differences):
        notes = [
            *notes,
            "some scenes or rays are not the same ones, so little else can be: was the same asked of both?",
        ]
    return {
        "verdict": verdict,
        "exact": {
            "cases": len(figures.cases),
            "differences": [
                {"case": d.comparison.name, "figure": d.figure, "old": d.old, "new": d.new, "change": d.change}
                for d in differences
            ],
        },
        "time": {"pairs": pairs_seen, "unit": unit, "comparisons": list(comparisons)},
        "notes": list(notes),
    }


# ---- a committed baseline ----


def _against_baseline(arguments):
    _need(len(arguments.folders) == 1, "--baseline takes one result folder")
    folder, path = arguments.folders[0], arguments.baseline
    figures = exact.figures_of(folder, own_only=True)
    known, accepted = (
        (exact.Figures({}, figures.names), []) if arguments.accept and not path.exists() else exact.read_baseline(path)
    )
    differences = exact.differences(known, figures)
    notes = _without_effect(folder)
    if arguments.accept is not None:
        _need(arguments.accept.strip(), "--accept: say why")
        if differences:
            commit = (pairs.facts_of(folder).get("build") or {}).get("commit")
            line = exact.acceptance(arguments.accept.strip(), differences if known.cases else [], commit)
            exact.write_baseline(path, figures, [*accepted, line])
            notes.append(f"{path}: {len(differences)} figures accepted: {arguments.accept.strip()}")
        else:
            notes.append(f"{path}: nothing differs, nothing to accept")
        differences = []
    elif differences:
        notes.append(f'if this is meant: raybench check {folder} --baseline {path} --accept "WHY"')
    return _check(figures, differences, notes=notes), differences


# ---- two result folders ----


def _folders(arguments):
    _need(len(arguments.folders) == 2, "give BASE and HEAD, or --run, --commits or --baseline")
    _need(arguments.accept is None, "--accept needs --baseline")
    base, head = arguments.folders
    known, figures = exact.figures_of(base), exact.figures_of(head)
    differences = exact.differences(known, figures)
    notes = _without_effect(head)
    if arguments.exact_only:
        return _check(figures, differences, notes=notes), differences
    if not arguments.anchor:
        notes.append(
            "times of two separate runs decide nothing where a machine's speed changes: compare by --run, "
            "or as ratios by --anchor, or say --exact-only"
        )
        return _check(figures, differences, undecided=True, notes=notes), differences
    ratios, look, fewest = unpaired.compare(base, head, arguments.anchor, arguments.tolerances.of)
    if look is None:
        notes.append(
            f"times: {fewest} processes on one side; from {unpaired.FEWEST} on each (raybench run --processes) "
            "ratios to an anchor are compared, since every process has its own memory layout"
        )
    tolerances = [arguments.tolerances.of(c) for c in ratios.comparisons]
    rows = output.time_rows(ratios, look, tolerances)
    notes += _left_out(ratios)
    return _check(figures, differences, rows, fewest, "processes", look is None, notes), differences


# ---- pairs ----


def _by_pairs(arguments):
    _need(not arguments.folders, "--run and --commits take no result folders")
    _need(not (arguments.run and arguments.commits), "give --run or --commits, not both")
    _need(arguments.accept is None, "--accept needs --baseline")
    with tempfile.TemporaryDirectory(prefix="raybench-check-") as temporary:
        work = Path(temporary)
        if arguments.commits:
            with commits.built(arguments.commits, arguments.build, arguments.binary, work) as commands:
                return _run_pairs(arguments, commands, work)
        return _run_pairs(arguments, arguments.run, work)


def _run_pairs(arguments, commands, work):
    programs = [pairs.Program(command, work / side) for side, command in zip(pairs.SIDES, commands)]
    budget = pairs.Budget(arguments.seconds, 0 if arguments.exact_only else arguments.pairs)
    if arguments.exact_only:
        for program in programs:
            program.judge()
        stream, ratios, look = None, None, None
    else:
        stream, ratios, look = pairs.run(
            programs, arguments.tolerances.of, budget, arguments.seed, arguments.anchor, arguments.all
        )
    figures = exact.figures_of(programs[1].folder)
    differences = exact.differences(exact.figures_of(programs[0].folder), figures)
    notes = _without_effect(programs[1].folder) + _machine_notes(programs[1].folder)
    if arguments.instructions:
        notes += instructions.compare(programs, work)
    if arguments.out and stream is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        stream.write(arguments.out / "pairs.csv")
        for side, program in zip(pairs.SIDES, programs):
            shutil.copytree(program.folder, arguments.out / side, dirs_exist_ok=True)
    rows, seen = [], 0
    if ratios is not None:
        seen = len(stream.times)
        rows = output.time_rows(ratios, look, [arguments.tolerances.of(c) for c in ratios.comparisons])
        notes += _left_out(ratios) + _pair_notes(stream, ratios, look)
    undecided = not arguments.exact_only and (look is None or bool(ratios.left_out))
    check = _check(figures, differences, rows, seen, "pairs", undecided, notes)
    check["commands"] = list(commands)
    return check, differences


def _pair_notes(stream, ratios, look):
    notes = []
    if look is None:
        price = f", and a pair takes {stream.each:.2g} s" if stream.times else ""
        more = f" ({math.ceil(1.2 * decision.FEWEST_PAIRS * stream.each)} beyond the judging)" if stream.times else ""
        notes.append(
            f"{len(stream.times)} pairs: a decision takes at least {decision.FEWEST_PAIRS}{price}; give more "
            f"--seconds{more}, smaller scenes, fewer --structures or --sets, or leave builds out "
            "(--benchmark_filter=-build)"
        )
        return notes
    effect = pairs.statistics.order_effect(ratios.log_ratios, stream.a_first)
    if effect is not None and effect[1] < 0.001:
        notes.append(
            f"whichever of a pair ran second took {output.percent(effect[0])}: the random order cancels it, but the "
            "machine warms up or is disturbed"
        )
    if look.verdict == decision.INCONCLUSIVE:
        notes.append("undecided: more --seconds, or a quieter machine (raybench doctor), decide more")
    return notes


def _left_out(ratios):
    return [f"{c.name}: not compared: {why}" for c, why in ratios.left_out.items()]


def _without_effect(folder):
    found = pairs.facts_of(folder).get("without_effect") or []
    return [
        f"{t['scene']}: {t['a']} and {t['b']} have the same tree and the same answers: "
        + (f"parameter without effect? ({', '.join(t['parameters'])})" if t["parameters"] else "two structures?")
        for t in found
    ]


def _machine_notes(folder):
    state = pairs.facts_of(folder).get("machine_state") or []
    return [f"{f['subject']}: {f['says']}" for f in state if f["severity"] == "warning"]
