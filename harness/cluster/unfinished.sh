#!/usr/bin/env bash
# Prints the indices of the shards in OUT/1 ... OUT/SHARDS that have not ended, with commas between, for sbatch --array.
set -euo pipefail
[ $# = 2 ] || { echo "usage: unfinished.sh OUT SHARDS" >&2; exit 2; }
open=
for ((i = 1; i <= $2; ++i)); do
  run=$1/$i/run.json
  # Keys of the outermost object stand behind one space.
  if ! grep -qs '^ "ended": "' "$run" || ! grep -qs '^ "interrupted": false' "$run"; then open+=,$i; fi
done
echo "${open#,}"
