"""How soon each saboteur is found: prints the table of tests/plugins/saboteurs/FOUND.md.

    python3 tests/tools/saboteur_table.py build/release > tests/plugins/saboteurs/FOUND.md

Each plugin goes through `raybench fuzz --findings 1` and `raybench check-plugin`, honest twins through
`raybench fuzz` alone.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path


def run(command):
    """Exit code and output of a command."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def findings_of(folder):
    """The findings of fuzz.json: those of the first case in front, of them the smallest (only a few are shrunk)."""
    file = folder / "fuzz.json"
    found = json.loads(file.read_text())["findings"] if file.is_file() else []
    return sorted(found, key=lambda f: (f["case_index"], f["primitives"] + f["rays"]))


def shown(finding):
    """Promise, seconds, cases."""
    return f"{finding['check']} | {finding['found_after_s']:.2f} | {finding['found_after_cases']}"


def row_of(raybench, plugin, seconds, folder):
    """A line of the table."""
    name = plugin.stem
    fuzz, check = folder / f"{name}-fuzz", folder / f"{name}-check"
    limit = seconds if name.startswith("honest_") else 60
    stop = [] if name.startswith("honest_") else ["--findings", "1"]
    code, text = run(
        [raybench, "fuzz", "--plugin", plugin, "--structures", name, "--seconds", limit, "--out", fuzz, *stop]
    )
    if code == 2:
        return f"| `{name}` | refused when loaded | | | | | | |"
    found = findings_of(fuzz)
    first = found[0] if found else None
    left = f"{shown(first)} | {first['primitives']} + {first['rays']}" if first else f"nothing in {limit} s | | | "
    if not stop:
        return f"| `{name}` | {left} | | | |"
    for limit in (seconds, 60):
        run([raybench, "check-plugin", plugin, "--seconds", limit, "--out", check])
        found = findings_of(check)
        if found:
            break
    right = shown(found[0]) if found else f"nothing in {limit} s | | "
    return f"| `{name}` | {left} | {right} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=Path, help="a build folder with raybench and the saboteurs")
    parser.add_argument("--seconds", type=int, default=4, help="for check-plugin, which gets 60 s where that is not enough, and for the twins; default 4")
    options = parser.parse_args()
    plugins = sorted((options.build / "tests/plugins/saboteurs").glob("*.so"))
    if not plugins:
        print(f"saboteur_table: {options.build}: no saboteurs; build the target `saboteurs`", file=sys.stderr)
        return 2
    print("# How soon each saboteur is found\n")
    print(f"Made by `saboteur_table.py BUILD --seconds {options.seconds}`: times depend on the machine,")
    print("cases do not but for the number of processes. Size: primitives + rays after shrinking.\n")
    print("| saboteur | `fuzz` finds | s | cases | size | `check-plugin` finds | s | cases |")
    print("|---|---|--:|--:|--:|---|--:|--:|")
    with tempfile.TemporaryDirectory() as folder:
        for plugin in plugins:
            print(row_of(options.build / "raybench", plugin, options.seconds, Path(folder)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
