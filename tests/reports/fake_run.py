"""Stands for `raybench run` in tests of `raybench check`: writes a result folder in a few milliseconds.

fake_run.py SLOWDOWN SPREAD [STEPS]: structure `own` takes 1 + SLOWDOWN times as long as `library`, up to noise of SPREAD;
the counter is STEPS. Then what check appends. Refuses what raybench refuses."""

import json
import random
import sys
from pathlib import Path

# no import of raybench_report: pandas takes longer than all this
FORMAT = 1
SETS = ["camera", "diffuse", "random"]


def main(slowdown, spread, *words):
    steps = "10.5"
    words = list(words)
    if words and not words[0].startswith("--"):
        steps = words.pop(0)
    if "--help" in words:
        print("  --again DIR  --keep-rays")
        return 0
    out = Path(words[words.index("--out") + 1])
    if "broken" in out.parts or slowdown == "broken":
        print("raybench: something is wrong with the input", file=sys.stderr)
        return 2
    if "--again" in words:
        assert (Path(words[words.index("--again") + 1]) / "run.json").is_file()
    out.mkdir(parents=True)
    columns = json.loads((Path(__file__).parents[2] / "reports/raybench_report/columns.json").read_text())
    rows = {}
    for table in ("cases.csv", "samples.csv"):
        rows[table] = [[name for line in columns["tables"][table] for name in line["columns"]]]
    noise = random.Random()
    speed = noise.gauss(0, 0.2)  # of the whole process
    for spec, factor in (("own", 1 + float(slowdown)), ("library", 1.0)):
        for ray_set in SETS:
            ns = 100 * factor * 2.718281828 ** (speed + noise.gauss(0, float(spread)))
            key = {"case_id": f"{spec}-{ray_set}", "scene": "fake", "structure": spec, "spec": spec, "ray_set": ray_set,
                   "query": "closest", "order": "traced", "threads": 1, "rays": 1000, "session": 0, "process": 0}  # fmt: skip
            case = {**key, "status": "timed", "timed_rays": 1000, "median_ns": ns, "steps": steps, "hits_digest": "d"}
            sample = {**key, "sample": 0, "sequence": 0, "passes": 1, "seconds": ns * 1e-6, "cpu_seconds": ns * 1e-6}
            for table, values in (("cases.csv", case), ("samples.csv", sample)):
                rows[table].append([str(values.get(name, "")) for name in rows[table][0]])
    for table, lines in rows.items():
        (out / table).write_text("\n".join(",".join(line) for line in lines) + "\n")
    (out / "run.json").write_text(json.dumps({"format": FORMAT, "without_effect": [], "machine_state": []}))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
