"""`raybench history`: runs kept over time, their trend with change points, exports for other tools."""

import argparse
import hashlib
import json
from pathlib import Path

from .. import results
from . import exports, samples

FORMAT = 1


def main(argv):
    """Returns 0. Throws RunError."""
    parser = argparse.ArgumentParser(prog="raybench history", allow_abbrev=False)
    commands = parser.add_subparsers(dest="command", required=True)
    add_parser = commands.add_parser("add")
    add_parser.add_argument("folder", type=Path)
    add_parser.add_argument("--store", type=Path, default=Path("history"))
    add_parser.add_argument("--commit")
    trend_parser = commands.add_parser("trend")
    trend_parser.add_argument("--store", type=Path, default=Path("history"))
    export_parser = commands.add_parser("export")
    export_parser.add_argument("folder", type=Path)
    export_parser.add_argument("--format", choices=sorted(exports.FORMATS), required=True)
    export_parser.add_argument("--out", type=Path)
    arguments = parser.parse_args(argv)
    if arguments.command == "add":
        print(f"{add(arguments.folder, arguments.store, arguments.commit)}")
    elif arguments.command == "trend":
        print(f"{_draw(arguments.store)}")
    else:
        text = json.dumps(exports.FORMATS[arguments.format](arguments.folder), indent=1) + "\n"
        if arguments.out:
            results.write_atomically(arguments.out, lambda path: path.write_text(text, encoding="utf-8"))
        else:
            print(text, end="")
    return 0


def _draw(store):
    """Writes STORE/trend.html, the report of the store, and returns its path."""
    from .. import page, report
    from ..kinds import history as kind

    read(store)  # says how to begin one where there is none
    found = report.read([store], [kind.KIND])
    page.write(store / "trend.html", found, kind.sections(found, found.others))
    return store / "trend.html"


def fingerprint(machine):
    """16 hex digits of what a time depends on besides the program: runs of other machines are kept apart."""
    keys = ("cpu", "cpu_flags", "logical_cpus", "allowed_cpus", "governor", "memory_bytes", "kernel")
    text = json.dumps({key: machine.get(key) for key in keys}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def add(folder, store, commit=None):
    """Writes STORE/FINGERPRINT/STARTED-COMMIT.json, one small file a run, and returns its path. The same run added again
    replaces it. Throws RunError."""
    info = results.read_info(folder / "run.json")
    machine = info.get("machine") or {}
    commit = commit or (info.get("build") or {}).get("commit") or "unknown"
    cases = samples.read_cases(folder)
    rows = []
    for _, row in results.timed(cases).iterrows():
        c = samples.comparison_of(row)
        known = {"ns": row["median_ns"], "lo": row["lo_ns"], "hi": row["hi_ns"], "anchor_ns": row["anchor_ns"]}
        rows.append({
            "case": [c.scene, c.spec, c.ray_set, c.order, c.query, c.threads],
            **{name: float(value) for name, value in known.items() if value == value},
        })  # fmt: skip
    if not rows:
        raise results.RunError(f"{folder}: no case has a time, so there is nothing to keep")
    started = str(info.get("started", "unknown"))
    entry = {"format": FORMAT, "started": started, "commit": commit, "fingerprint": fingerprint(machine),
             "cpu": machine.get("cpu"), "cases": rows}  # fmt: skip
    path = store / entry["fingerprint"] / f"{started.replace(':', '-')}-{commit[:12]}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(entry) + "\n"
    results.write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    return path


def read(store):
    """{fingerprint: entries from the oldest to the newest}. Throws RunError."""
    found = {}
    for path in sorted(store.glob("*/*.json")):
        entry = results.read_json(path)
        if entry.get("format") != FORMAT:
            raise results.RunError(f"{path}: not a history entry of format {FORMAT}")
        found.setdefault(entry["fingerprint"], []).append(entry)
    if not found:
        raise results.RunError(f"{store}: no history; begin it by: raybench history add DIR --store {store}")
    for entries in found.values():
        entries.sort(key=lambda entry: entry["started"])
    return found
