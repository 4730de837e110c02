#!/usr/bin/env bash
# Builds the targets of libFuzzer and gives each some time; README.md here.
set -euo pipefail

usage='usage: run.sh [SECONDS] [TARGET...]
Builds with Clang and gives each target so many seconds (default 60); default: all targets.'
case ${1:-} in --help | -h) echo "$usage"; exit 0 ;; esac
seconds=${1:-60}
[[ $seconds =~ ^[1-9][0-9]*$ ]] || { echo "run.sh: '$seconds' is no number of seconds" >&2; exit 2; }
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || targets=(obj off ply stl nff gltf glb mtl rays parameters case core)

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)
root=$(cd "$here/../../.." && pwd -P)
build=$root/build/libfuzzer
cd "$root"
command -v clang++ >/dev/null || { echo "run.sh: no clang++ here; see README.md" >&2; exit 2; }
for target in "${targets[@]}"; do
  grep -qw "$target" "$here/CMakeLists.txt" || { echo "run.sh: unknown target '$target'" >&2; exit 2; }
done
cmake --preset libfuzzer >/dev/null
cmake --build --preset libfuzzer

TMPDIR=$(mktemp -d)
export TMPDIR ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=0
trap 'rm -rf "$TMPDIR"' EXIT

found=0
for target in "${targets[@]}"; do
  corpus=$build/corpus/$target findings=$build/findings/$target log=$build/$target.log
  mkdir -p "$corpus" "$findings"
  "$here/seeds.py" "$target" "$corpus"
  before=$(find "$findings" -type f | wc -l)
  code=0
  "$build/tests/fuzz/libfuzzer/$target" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2560 -max_len=8192 \
    -dict="$here/words.dict" -fork="${RAYBENCH_FUZZ_JOBS:-1}" -ignore_crashes=1 -ignore_ooms=1 -ignore_timeouts=1 -artifact_prefix="$findings/" \
    "$corpus" >"$log" 2>&1 || code=$?
  new=$(($(find "$findings" -type f | wc -l) - before))
  runs=$(grep -o '^#[0-9]*' "$log" | tail -n 1 | tr -d '#')
  printf '%-12s %9s inputs in %s s, corpus %5s, %s found (exit %s)\n' \
    "$target" "${runs:-0}" "$seconds" "$(find "$corpus" -type f | wc -l)" "$new" "$code"
  [ "$new" = 0 ] || found=1
done
exit $found
