"""Compares two result folders in everything but times: python3 same.py A B. Exit code 1 where they differ."""

import csv
import json
import pathlib
import sys

COLUMNS = json.loads((pathlib.Path(__file__).parents[2] / "reports/raybench_report/columns.json").read_text())
VARYING = {name for entry in COLUMNS["tables"]["cases.csv"] if entry.get("varies") for name in entry["columns"]}


def rows(folder):
    with open(pathlib.Path(folder) / "cases.csv", newline="") as file:
        return [{k: v for k, v in row.items() if k not in VARYING} for row in csv.DictReader(file)]


a, b = (rows(folder) for folder in sys.argv[1:3])
if not a or a != b:
    different = [f"{x['case_id']} {x['spec']} {x['ray_set']}" for x, y in zip(a, b) if x != y]
    sys.exit(f"{len(a)} and {len(b)} cases; different: {different[:5]}")
print(f"{len(a)} cases are the same in everything but times")
