"""What tuning brings: `raybench tune` for five structures on five scenes, as a table. reports/TUNE.md has it.

    python3 tests/tools/tune_table.py build/release/raybench --out tuned

`--out` keeps what each run wrote.
"""

import argparse
import json
import subprocess
from pathlib import Path

SCENES = ["stadium", "bunny", "soup", "terrain", "city"]
STRUCTURES = ["grid", "octree", "kdtree_sah", "bvh_sah", "embree"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--structures", nargs="+", default=STRUCTURES)
    parser.add_argument("--rays", default="10000000")
    parser.add_argument("--evaluations", default="60")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    print("| the default takes, times the tuned one | " + " | ".join(arguments.structures) + " |")
    print("|---" * (1 + len(arguments.structures)) + "|", flush=True)
    tuned = []
    for scene in arguments.scenes:
        cells = [scene]
        for structure in arguments.structures:
            folder = arguments.out / f"{scene}_{structure}"
            words = ["tune", scene, "--structure", structure, "--rays", arguments.rays]
            words += ["--evaluations", arguments.evaluations, "--out", str(folder)]
            subprocess.run([arguments.program, *words], check=True, stdout=subprocess.DEVNULL)
            tune = json.loads((folder / "tune.json").read_text())
            cells.append(_cell(tune))
            tuned.append((tune["gain"], scene, tune["tuned"]))
        print(f"| {' | '.join(cells)} |", flush=True)
    for _, scene, spec in sorted(tuned, reverse=True)[:4]:
        print(f"    {scene}: {spec}")


def _cell(tune):
    if tune["tuned"] == tune["default"]:
        return "1.00, stays"
    interval = f" ({tune['gain_lo']:.2f} to {tune['gain_hi']:.2f})" if tune["gain_hi"] else ""
    return f"{tune['gain']:.2f}{interval}"


if __name__ == "__main__":
    main()
