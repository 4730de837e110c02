#!/usr/bin/env bash
# Run in the worktree of each commit: makes the plugin, and records rays. RAYBENCH names raybench's source folder.
set -euo pipefail
: "${RAYBENCH:?names raybench\'s source folder}"
c++ -std=c++20 -O3 -march=native -ffp-contract=off -fno-tree-slp-vectorize -shared -fPIC -I "$RAYBENCH" \
  structure.cpp -o mine.so
cc -std=c11 -O2 -I "$RAYBENCH/tracer/rays/recorder" "$RAYBENCH/tracer/rays/recorder/example.c" -o tracer -lm
./tracer rays >/dev/null
