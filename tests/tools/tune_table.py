#!/usr/bin/env python3
"""What tuning brings: `raybench tune` for five structures on five scenes, as a table. reports/TUNE.md has it.

    python3 tests/tools/tune_table.py build/release/raybench --out tuned
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
    print("| scene | structure | default takes, times the tuned one | 95 % | tuned |\n" + "|---" * 5 + "|")
    for scene in arguments.scenes:
        for structure in arguments.structures:
            folder = arguments.out / f"{scene}_{structure}"
            words = ["tune", scene, "--structure", structure, "--rays", arguments.rays]
            words += ["--evaluations", arguments.evaluations, "--out", str(folder)]
            subprocess.run([arguments.program, *words], check=True, stdout=subprocess.DEVNULL)
            tune = json.loads((folder / "tune.json").read_text())
            interval = "-" if tune["gain_hi"] is None else f"{tune['gain_lo']:.2f} to {tune['gain_hi']:.2f}"
            print(f"| {scene} | {structure} | {tune['gain']:.2f} | {interval} | `{tune['tuned']}` |", flush=True)


if __name__ == "__main__":
    main()
