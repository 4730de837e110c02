#!/usr/bin/env bash
# A sweep under ReFrame's local scheduler for real: four shards, one at a time; merged; compared with the whole run.
# usage: tests/cluster/reframe.sh [RAYBENCH]; makes a virtual environment with ReFrame in build/reframe if none is there.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
raybench=$(realpath "${1:-$root/build/release/raybench}")
venv=${REFRAME_VENV:-$root/build/reframe}
[ -x "$venv/bin/reframe" ] || {
  python3 -m venv "$venv"
  "$venv/bin/pip" install -q ReFrame-HPC==4.10.4
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
RAYBENCH_SHARDS=4 "$venv/bin/reframe" -c "$root/harness/cluster/raybench_reframe.py" --prefix "$work/reframe" \
  --exec-policy=serial --perflogdir "$work/perf" --report-file "$work/report.json" -S "raybench=$raybench" \
  -S "suite=$here/suite.toml" -S "out=$work/out" -r >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
python3 - "$work/report.json" <<'CHECK'
import json, sys
report = json.load(open(sys.argv[1]))
cases = [case for run in report["runs"] for case in run.get("testcases", [])]
figures = [case.get("perfvalues") or case.get("perfvars") for case in cases]
assert len(cases) == 4 and all(figures), (len(cases), figures)
print("ReFrame ran 4 shards with", sum(len(f) for f in figures), "performance variables")
CHECK
"$raybench" merge "$work/merged" "$work"/out/{1,2,3,4} >/dev/null
"$raybench" run --suite "$here/suite.toml" --no-report --out "$work/whole" >/dev/null 2>&1
python3 "$here/same.py" "$work/whole" "$work/merged"
