#!/usr/bin/env bash
# Sets up whatever is missing, builds a release and runs the benchmark.
set -euo pipefail

if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  cat <<'USAGE'
usage: bench.sh [ARGUMENT...]
Installs what is missing (Debian 12 or 13, as root or with sudo), builds build/release and runs
    build/release/raybench run ARGUMENT...
Without arguments that is the main job. Examples:
    ./bench.sh --quick
    ./bench.sh my_model.glb --structures bvh_sah,embree --out results/mine
RAYBENCH_NO_INSTALL=1 leaves the system's packages alone.
USAGE
  raybench=$(dirname "${BASH_SOURCE[0]}")/build/release/raybench
  if [ -x "$raybench" ]; then
    echo
    exec "$raybench" run --help
  fi
  exit 0
fi

source "$(dirname "${BASH_SOURCE[0]}")/.ci/setup.sh"
build_preset release raybench
say "raybench run $*"
exec "$build/release/raybench" run "$@"
