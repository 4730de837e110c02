"""`raybench tradeoff`: reads what was typed, measures, draws fronts, says what dominates what."""

import argparse
import datetime
import json
import os
import re
import shutil
import signal
import sys
import time
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path

import pandas as pd

from .. import columns
from ..decide.pairs import Progress
from ..results import RunError
from . import fronts, images, knobs, renders, structures
from .files import require_folder
from .program import Program

BROKEN = 1  # exit code: a claim is broken, or what must be exact disagrees


@dataclass
class Settings:
    """The numbers of a sweep; a suite's keys, and options on the command line."""

    scenes: list = field(default_factory=list)
    knobs: list = field(default_factory=lambda: list(knobs.DEFAULT))
    seconds: float = 180
    rays: int = 16384
    verify_rays: int = 32768
    repetitions: int = 21
    size: tuple = (192, 192)
    size_given: bool = False
    samples: int = 7
    reference_samples: int = 64
    reference_seconds: float = 60
    structure: str = "bvh_wide"
    seed: int = 1
    quick: bool = False


QUICK = {
    "seconds": 40, "rays": 4096, "verify_rays": 4096, "repetitions": 6, "size": (96, 96), "samples": 6,
    "reference_samples": 16, "reference_seconds": 10,
}  # fmt: skip

# key of a suite → (type as said, check)
_whole = lambda lo, hi: (f"a whole number from {lo} to {hi}", lambda v: type(v) is int and lo <= v <= hi)
_texts = ("a list of texts", lambda v: isinstance(v, list) and v and all(isinstance(x, str) for x in v))
KEYS = {
    "doc": ("a text", lambda v: isinstance(v, str)),
    "scenes": _texts,
    "knobs": _texts,
    "seconds": ("a number from 0.001 to 1000000", lambda v: type(v) in (int, float) and 0.001 <= v <= 1e6),
    "rays": _whole(64, 1 << 28),
    "verify_rays": _whole(64, 1 << 28),
    "repetitions": _whole(1, 10000),
    "size": ("[width, height], each 16 to 16384", lambda v: isinstance(v, list) and len(v) == 2 and all(type(x) is int and 16 <= x <= 16384 for x in v)),
    "samples": _whole(1, 1000),
    "reference_samples": _whole(2, 64),
    "reference_seconds": ("a number from 0.1 to 1000000", lambda v: type(v) in (int, float) and 0.1 <= v <= 1e6),
    "structure": ("a text", lambda v: isinstance(v, str)),
    "seed": _whole(0, 2**63 - 1),
}  # fmt: skip


def main(argv):
    """Returns the exit code: 0, or 1 where a claim is broken. Throws RunError for wrong input."""
    arguments = _parser().parse_args(argv)
    if arguments.list:
        print(knobs.text_of_all(), end="")
        return 0
    signal.signal(signal.SIGTERM, _stop)
    settings = _settings(arguments)
    say = Progress()
    program = Program(arguments.program, arguments.plugin, say)
    out = arguments.out or Path("results") / f"tradeoff-{datetime.datetime.now(datetime.UTC):%Y%m%dT%H%M%SZ}"
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunError(f"{out}: exists already; name another folder with --out")
    require_folder(out)
    holder = out.parent / f".{out.name}.{os.getpid()}"
    work = holder / out.name  # the page has its name; moved when all is there
    begin = time.monotonic()
    try:
        work.mkdir(parents=True)
        rows, notes = _sweep(program, settings, work, say)
        say(None)
        found = fronts.fronts(rows)
        bad = rows[rows["status"].isin(["refused", "disagrees"])]
        facts = _facts(settings, argv, work, notes, fronts.sentences(found, len(settings.scenes)), begin, bad)
        _write(work, rows, found, facts)
        if not arguments.no_report:
            _report(work)
        if out.exists():
            out.rmdir()
        os.replace(work, out)
    except KeyboardInterrupt:
        say(None)
        print("raybench: interrupted; nothing was written", file=sys.stderr)
        return 130
    finally:
        say(None)
        shutil.rmtree(holder, ignore_errors=True)
    print(_text(found, rows, bad, facts, out, arguments.no_report), end="")
    return BROKEN if len(bad) else 0


def _stop(*_):
    raise KeyboardInterrupt


def _parser():
    parser = argparse.ArgumentParser(prog="raybench tradeoff", allow_abbrev=False)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--program", default="raybench")
    parser.add_argument("--plugin", action="append", default=[])
    parser.add_argument("--knobs")
    parser.add_argument("--suite", type=Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--rays", type=int)
    parser.add_argument("--verify-rays", type=int)
    parser.add_argument("--size")
    parser.add_argument("--samples", type=int)
    parser.add_argument("--reference-samples", type=int)
    parser.add_argument("--structure")
    parser.add_argument("--seed", type=int)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--no-report", action="store_true")
    return parser


# ---- what is asked ----


def _settings(arguments):
    settings = Settings(quick=arguments.quick, **(QUICK if arguments.quick else {}))
    if arguments.suite:
        _take_suite(settings, arguments.suite)
    if arguments.scenes:
        settings.scenes = arguments.scenes
    if arguments.knobs is not None:
        settings.knobs = [arguments.knobs]
    for name in ("seconds", "rays", "verify_rays", "samples", "reference_samples", "structure", "seed"):
        if (value := getattr(arguments, name)) is not None:
            setattr(settings, name, value)
    if arguments.size:
        found = re.fullmatch(r"(\d{2,5})x(\d{2,5})", arguments.size)
        size = tuple(map(int, found.groups())) if found else (0, 0)
        if not all(16 <= s <= 16384 for s in size):
            raise RunError(f"--size {arguments.size}: write WIDTHxHEIGHT, each 16 to 16384")
        settings.size, settings.size_given = size, True
    if not settings.scenes:
        raise RunError("tradeoff: name a scene, such as: raybench tradeoff bunny")
    return settings


def _take_suite(settings, path):
    """A suite's keys. Throws RunError with file and key."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunError(f"{path}: cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RunError(f"{path}: not TOML: {error}") from None
    for key, value in table.items():
        if key not in KEYS:
            raise RunError(f"{path}: {key}: unknown key{knobs.meant(key, KEYS)}; allowed: {', '.join(KEYS)}")
        text, good = KEYS[key]
        if not good(value):
            raise RunError(f"{path}: {key}: allowed: {text}")
        if key == "size":
            settings.size, settings.size_given = tuple(value), True
        elif key != "doc":
            setattr(settings, key, value)


# ---- measuring ----


def _sweep(program, settings, work, say):
    """(rows of tradeoff.csv, notes) of all scenes. Everything that can be wrong with what was asked comes first."""
    known = knobs.Structures(program)
    known.full(settings.structure)
    plans = []
    for scene in settings.scenes:
        facts = program.list("scene", scene)
        chosen = knobs.choose(",".join(settings.knobs), known, facts, settings.quick)
        if any(p.knob in knobs.LEVELS for p in chosen.points) and not _has_decimate(program):
            chosen.points = [p for p in chosen.points if p.knob not in knobs.LEVELS]
            chosen.left_out.append("lod: left out: this raybench has no modifier `decimate`")
        for point in chosen.structures:
            known.full(point.spec)
        share = settings.seconds / max(1, bool(chosen.structures) + bool(chosen.pictures))
        if chosen.structures:
            structures.case_seconds(len(chosen.structures), structures.sets_of(chosen.structures, facts), share)
        renders.check_budget(len(chosen.pictures), share)
        plans.append((scene, facts, chosen, share))
    if any(plan[2].points for plan in plans):
        print(_plan(plans, settings), file=sys.stderr)
    rows, notes = [], []
    if images.flip_evaluator is None and any(plan[2].pictures for plan in plans):
        notes.append(
            "FLIP is left out: the package flip-evaluator is not there (its wheels are for x86-64); fronts show RMSE"
        )
    for at, (scene, facts, chosen, share) in enumerate(plans):
        prefix = f"{scene}: " if len(plans) > 1 else ""
        notes += [prefix + text for text in chosen.left_out]
        folder = work / f"scene_{at + 1}" if len(plans) > 1 else work
        if chosen.structures:
            rows += structures.measure(program, scene, chosen.structures, known, facts, settings, share, folder)
        if chosen.pictures:
            more, said = renders.measure(program, scene, chosen.pictures, settings, share, folder, say)
            for row in more:
                for name in ("picture", "difference"):
                    if row.get(name):
                        row[name] = str((folder / row[name]).relative_to(work))
            rows += more
            notes += [prefix + text for text in said]
    if not rows:
        raise RunError("nothing to measure: " + ("; ".join(notes) or "no knob has a point"))
    names = [name for name, *_ in columns.columns_of("tradeoff.csv")]
    table = pd.DataFrame(rows).reindex(columns=names)
    text = [name for name, kind, *_ in columns.columns_of("tradeoff.csv") if kind == "text"]
    table[text] = table[text].fillna("")
    return table, notes


def _plan(plans, settings):
    """One line: how much is measured, and about how long that takes."""
    structs, pictures = (sum(len(getattr(plan[2], what)) for plan in plans) for what in ("structures", "pictures"))
    parts = [f"{structs} structures"] * bool(structs) + [f"{pictures} pictures"] * bool(pictures)
    timing = settings.seconds * len(plans)
    return (
        f"raybench: {' and '.join(parts)} to measure; timing takes about {timing:.0f} s (--seconds), building, "
        f"judging and references as long again, more where a picture takes seconds to load"
    )


def _has_decimate(program):
    return any(entry["name"] == "decimate" for entry in program.list("generators")["modifiers"])


# ---- what is left ----


def _facts(settings, argv, work, notes, says, begin, bad):
    """tradeoff.json: with machine and build of a run, where there was one."""
    run = next(iter(sorted(work.glob("**/run/run.json"))), None)
    info = json.loads(run.read_text(encoding="utf-8")) if run else {}
    kept = {name: info[name] for name in ("machine", "build", "libraries", "timing", "machine_state") if name in info}
    words = ["raybench", "tradeoff", *(word for word in argv if not word.startswith("--program="))]
    return {
        "format": columns.FORMAT,
        "command_line": words,
        "started": (datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=time.monotonic() - begin)).isoformat(timespec="seconds"),
        "seconds": round(time.monotonic() - begin, 1),
        "seed": settings.seed,
        "settings": asdict(settings),
        "flip": getattr(images.flip_evaluator, "__name__", None),
        "broken": [f"{r.point}: {r.note or r.status}" for r in bad.itertuples()],
        "says": says,
        "notes": notes,
    } | kept  # fmt: skip


def _write(work, rows, found, facts):
    counts = [name for name, kind, *_ in columns.columns_of("tradeoff.csv") if kind in ("count", "flag")]
    rows = rows.copy()
    rows[counts] = rows[counts].astype("Int64")
    rows.to_csv(work / "tradeoff.csv", index=False)
    fronts.table(found).to_csv(work / "fronts.csv", index=False)
    (work / "tradeoff.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    for part in work.glob("**/pictures/*.exr"):
        part.unlink()


def _report(work):
    from ..__main__ import write_page

    write_page([work], work / "report.html")


def _text(found, rows, bad, facts, out, no_report):
    """For the terminal: fronts, what is broken, notes, sentences, files."""
    lines = []
    for front in found:
        if (
            front.ray_set in ("camera", "diffuse")
            or front.name in ("t_error", "lod_memory")
            or front.name.endswith(":build")
        ):
            continue  # in fronts.csv and on the page
        where = " ".join(x for x in (front.scene, f"({front.ray_set} rays)" if front.ray_set else "") if x)
        lines += [f"{front.title}: {where}", *fronts.lines(front), ""]
    for r in bad.itertuples():
        lines.append(f"{r.status.upper()}: {r.point}: {r.note}; {r.error_command}")
    skipped = rows[rows["status"] == "skipped"].drop_duplicates(["scene", "point"])
    lines += [f"skipped: {r.point}: {r.note}" for r in skipped.itertuples()]
    lines += [f"note: {note}" for note in facts["notes"]]
    lines += [*facts["says"], ""] if facts["says"] else []
    lines.append(f"points  {out / 'tradeoff.csv'} (each with the command that measures it again)")
    lines.append(f"fronts  {out / 'fronts.csv'}")
    if not no_report:
        lines.append(f"report  {out / 'report.html'}")
    lines.append(f"took    {facts['seconds']:.0f} s")
    return "\n".join(lines) + "\n"
