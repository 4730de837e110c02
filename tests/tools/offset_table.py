"""The smallest safe offsets of some scenes at three scales: prints the table of reports/OFFSET.md.

    python3 tests/tools/offset_table.py build/release/raybench results/offset [SCENE ...] [-- OPTION ...]

Runs `raybench offset "scale(SCENE,factor=F)" --out FOLDER` for each scene and factor that has no result yet.
"""

import csv
import subprocess
import sys
from pathlib import Path

SCENES = ["icosphere(level=5)", "shells(count=256)", "terrain", "menger(depth=3)", "bunny", "sponza"]
FACTORS = ["1e-6", "1", "1e6"]


def number(text):
    """Three digits."""
    return f"{float(text):.3g}"


def cells(rows, cure):
    """Of one cure: the safe offsets, and what was seen just outside."""
    seen = {row["role"]: row for row in rows if row["cure"] == cure and row["role"] != "scan"}
    named = seen["named"]
    rates = f"{named['self_hits']} / {named['lost']}"
    if not named["offset"]:
        return rates
    lo, hi = (float(seen[role]["offset"]) if role in seen else None for role in ("smallest_safe", "largest_safe"))
    if named["safe"] != "1" or lo is None or hi is None or lo > hi:
        return f"none (at {number(named['offset'])}: {rates})"
    text = f"{number(lo)} to {number(hi)}{'' if 'above' in seen else ' (all)'}"
    outside = [seen[role][fault] for role, fault in (("below", "self_hits"), ("above", "lost")) if role in seen]
    return f"{text} (outside: {' / '.join(outside)})"


def main():
    words = sys.argv[1:]
    options = words[words.index("--") + 1 :] if "--" in words else []
    words = words[: words.index("--")] if "--" in words else words
    raybench, folder, scenes = words[0], Path(words[1]), words[2:] or SCENES
    cures = ["error-bound", "skip", "integer-offset", "normal-offset", "tnear", "none"]
    print(f"| scene | scale | {' | '.join(cures)} |\n|---|---|{'---|' * len(cures)}")
    for scene in scenes:
        for factor in FACTORS:
            out = folder / f"{scene.split('(')[0]}_{factor}"
            if not (out / "offset.csv").is_file():
                command = [raybench, "offset", f"scale({scene},factor={factor})", "--out", str(out), *options]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode not in (0, 1):
                    sys.exit(done.stderr)
                (out / "offset.txt").write_text(done.stdout)
            with open(out / "offset.csv", newline="") as file:
                rows = list(csv.DictReader(file))
            print(f"| `{scene}` | {factor} | {' | '.join(cells(rows, cure) for cure in cures)} |", flush=True)


if __name__ == "__main__":
    main()
