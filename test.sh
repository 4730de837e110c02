#!/usr/bin/env bash
# Sets up whatever is missing, builds a release and runs all tests.
set -euo pipefail

usage() {
  cat <<'USAGE'
usage: test.sh [--build-only] [--filter REGEX] [--sanitize] [--tsan]
Installs what is missing (Debian 12 or 13, as root or with sudo), builds build/release and runs all tests: those in
C++ through ctest, those of the reports through pytest.
  --build-only    stop when everything is built
  --filter REGEX  only tests whose name matches (extended regular expression)
  --sanitize      build and test with AddressSanitizer and UndefinedBehaviorSanitizer too
  --tsan          build and test the C++ code with ThreadSanitizer too; takes long
RAYBENCH_NO_INSTALL=1 leaves the system's packages alone.
USAGE
}

build_only=no filter='' presets=(release)
while [ $# -gt 0 ]; do
  case $1 in
    --build-only) build_only=yes ;;
    --filter)
      [ $# -ge 2 ] || { echo "test.sh: --filter needs a regular expression" >&2; exit 2; }
      filter=$2
      shift ;;
    --sanitize) presets=(asan-ubsan "${presets[@]}") ;;
    --tsan) presets=(tsan "${presets[@]}") ;;
    --help | -h)
      usage
      exit 0 ;;
    *)
      echo "test.sh: unknown argument '$1'; allowed: --build-only, --filter REGEX, --sanitize, --tsan, --help" >&2
      exit 2 ;;
  esac
  shift
done

# the tests of the report page run it in a browser, those of vulkan_rt on a software driver
more_packages=(glslang-tools libvulkan-dev)
[ $build_only = yes ] || more_packages+=(chromium mesa-vulkan-drivers vulkan-validationlayers)
source "$(dirname "${BASH_SOURCE[0]}")/.ci/setup.sh"
cd "$root"
for preset in "${presets[@]}"; do
  build_preset "$preset"
done
[ $build_only = no ] || exit 0

# Whatever GPU is there: tests need the same driver everywhere.
if driver=$("$root/.ci/lavapipe.sh" "$build/vulkan"); then
  export VK_DRIVER_FILES=$driver
else
  say "THE TESTS OF vulkan_rt ARE SKIPPED: no software Vulkan driver with ray tracing here"
fi
python=("$build/venv/bin/python" -m pytest -q --rootdir "$root" -o "cache_dir=$build/pytest_cache")
select=() python_tests=(tests)
if [ -n "$filter" ]; then
  select=(-R "$filter")
  mapfile -t python_tests < <("${python[@]}" --collect-only tests | grep '::' | grep -E -e "$filter" || true)
  matches=$(ctest --preset release-single -N "${select[@]}" | sed -n 's/^Total Tests: //p')
  [ "$matches" != 0 ] || [ ${#python_tests[@]} -gt 0 ] || fail "no test matches '$filter'"
fi

failed=no
for preset in "${presets[@]}"; do
  say "C++ tests, $preset"
  tests=$preset
  [ -z "$filter" ] || tests=$preset-single
  ctest --preset "$tests" -j "$jobs" "${select[@]}" || failed=yes
done
if [ ${#python_tests[@]} -gt 0 ]; then
  say "Python tests"
  "${python[@]}" "${python_tests[@]}" || failed=yes
fi
[ $failed = no ]
