#!/usr/bin/env bash
# Measures vulkan_rt on a machine with a GPU that has nothing but its driver: no compiler, no packages, no network.
set -euo pipefail

usage() {
  cat <<'USAGE'
usage: tests/tools/vulkan_gpu.sh pack BUILD FOLDER   here: puts what is needed into FOLDER, some 400 MB
       FOLDER/vulkan_gpu.sh run OUT [small]          there: rows, verdicts and pictures into OUT, at most 8 minutes;
                                                     small: a try of the script, for a software driver
BUILD is a build folder, best of the preset portable (cmake --preset portable, targets raybench and vulkan_rt).
Steps that fail do not end the others; OUT/summary.txt says how each ended.
USAGE
  exit 2
}

pack() {
  local build=$1 folder=$2
  for file in raybench plugins/vulkan_rt.so lib/libraybench_images.so; do
    [ -e "$build/$file" ] || { echo "vulkan_gpu.sh: $build/$file is not there" >&2; exit 2; }
  done
  mkdir -p "$folder/lib" "$folder/plugins" "$folder/shared/gcc"
  cp "$build/raybench" "$0" "$folder"
  cp "$build/plugins/vulkan_rt.so" "$folder/plugins"
  cp "$build/lib/libraybench_images.so" "$folder/lib"
  # All shared libraries but the C library's own, which belong to the kernel and driver there.
  ldd "$folder/raybench" "$folder"/plugins/*.so "$folder"/lib/*.so | awk '$2 == "=>" && $3 ~ /^\// {print $3}' | sort -u |
    grep -v -E '/(libc|libm|libdl|libpthread|librt|ld-linux[^/]*)\.so' | xargs -r cp -L -t "$folder/shared"
  # The driver may need a newer C++ runtime than the program.
  mv "$folder"/shared/libstdc++.so.* "$folder"/shared/libgcc_s.so.* "$folder/shared/gcc"
  du -sh "$folder"
}

run() {
  local here out=$1 rays=128K level=6 terrain=1000000 depth=5 rings=5 gears=4 side=1024
  [ "${2:-}" != small ] || { rays=2K level=3 terrain=2000 depth=2 rings=2 gears=2 side=64; }
  here=$(cd "$(dirname "$0")" && pwd -P)
  mkdir -p "$out"
  out=$(cd "$out" && pwd -P)
  export LD_LIBRARY_PATH=$here/shared${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} RAYBENCH_CACHE=$out/cache
  "$here/raybench" --version >/dev/null 2>&1 || LD_LIBRARY_PATH=$here/shared/gcc:$LD_LIBRARY_PATH
  # Containers often have NVIDIA's driver without the file that names it to Vulkan.
  if ! compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null && ! compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null; then
    local library
    library=$(ldconfig -p | awk '/libGLX_nvidia\.so\.0|libEGL_nvidia\.so\.0/ {print $NF; exit}')
    [ -z "$library" ] || printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.3.0"}}\n' \
      "$library" >"$out/icd.json"
    [ -z "$library" ] || export VK_DRIVER_FILES=$out/icd.json
  fi
  local end=$((SECONDS + 470))
  step() { # NAME SECONDS ARGUMENT...: raybench with these arguments
    local name=$1 most=$2 left=$((end - SECONDS)) code=0
    shift 2
    [ "$left" -ge 5 ] || { echo "$name: left out, no time" >>"$out/summary.txt"; return 0; }
    [ "$most" -le "$left" ] || most=$left
    local start=$SECONDS
    timeout "$most" "$here/raybench" "$@" >"$out/$name.txt" 2>&1 || code=$?
    echo "$name: exit $code, $((SECONDS - start)) s: raybench $*" >>"$out/summary.txt"
  }
  : >"$out/summary.txt"
  step list 20 list structures
  step structure 20 list structure vulkan_rt
  local both="vulkan_rt,vulkan_rt(path=pipeline)" scene
  step verify 90 verify "icosphere(level=$level)" --structures "$both" --rays "$rays" --out "$out/verify"
  step run 150 run "terrain(size=$terrain)" "sphereflake(depth=$depth)" --quick --no-report --out "$out/run" --structures \
    "$both,vulkan_rt(opaque=false),vulkan_rt(build=fast_build),vulkan_rt(build=low_memory,compaction=true),bvh_sah(numerics=fast),bvh_wide"
  for scene in "sphereflake(depth=$depth)" "rings(size=$rings)" "gears(size=$gears)"; do
    local stem=${scene%%(*}
    step "$stem.host" 40 render "$scene" --structure "bvh_sah(numerics=fast)" --waves host --size "${side}x$side" -o "$out/$stem.host.exr"
    step "$stem.device" 40 render "$scene" --structure vulkan_rt --waves device --size "${side}x$side" -o "$out/$stem.device.exr"
    step "$stem.pipeline" 40 render "$scene" --structure "vulkan_rt(path=pipeline)" --size "${side}x$side" -o "$out/$stem.pipeline.exr"
  done
  [ "${2:-}" = small ] || step spd 60 spd balls rings --structure vulkan_rt
  cat "$out/summary.txt"
}

case ${1:-} in
  pack) [ $# = 3 ] || usage; pack "$2" "$3" ;;
  run) [ $# = 2 ] || { [ $# = 3 ] && [ "$3" = small ]; } || usage; run "${@:2}" ;;
  *) usage ;;
esac
