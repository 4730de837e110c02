# shellcheck shell=bash
# Sourced by bench.sh, action.yml and test.sh (which names more_packages): installs what is missing, makes the Python environment, configures and builds.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
build=$root/build
export LC_ALL=C.UTF-8
export HOME=${HOME:-$(getent passwd "$(id -u)" | cut -d: -f6)}

packages=(
  build-essential ca-certificates ccache cmake git ninja-build python3 python3-venv
  libbenchmark-dev libboost-dev libcgal-dev libcli11-dev libembree-dev libfmt-dev libgmock-dev libgtest-dev
  libopenimageio-dev libopenmesh-dev libtbb-dev libtinygltf-dev libtomlplusplus-dev nlohmann-json3-dev openimageio-tools
  ${more_packages[@]+"${more_packages[@]}"}
)
needed="a C++20 compiler, CMake 3.25, Ninja, Git, Python 3.11 with venv, and the development packages of Embree 3 or 4, \
Boost, CGAL, Google Benchmark, OpenMesh, tinygltf, OpenImageIO (with its tools), oneTBB, fmt, CLI11, nlohmann-json, toml++, \
GoogleTest with GoogleMock; for vulkan_rt also those of Vulkan's loader, and glslangValidator"

say() { printf '== %s\n' "$*"; }
fail() {
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit 2
}

# Runs a command with its output in build/NAME.log; on failure shows the end of it.
logged() {
  local log=$build/$1.log
  shift
  if ! "$@" >"$log" 2>&1 </dev/null; then
    tail -n 30 "$log" >&2
    return 1
  fi
}

is_supported_debian() {
  [ -r /etc/os-release ] && (
    # shellcheck disable=SC1091
    . /etc/os-release
    [ "${ID:-}" = debian ] && { [ "${VERSION_ID:-}" = 12 ] || [ "${VERSION_ID:-}" = 13 ]; }
  )
}

install_packages() {
  local installed package missing=() as_root=() apt=(apt-get -q -y -o Acquire::Retries=3 -o DPkg::Lock::Timeout=300)
  # shellcheck disable=SC2016 # dpkg-query expands these; it fails when it knows one of them not at all
  installed=$(dpkg-query -W -f='${db:Status-Status}:${Package}\n' "${packages[@]}" 2>/dev/null || true)
  for package in "${packages[@]}"; do
    [[ $'\n'$installed$'\n' == *$'\n'"installed:$package"$'\n'* ]] || missing+=("$package")
  done
  [ ${#missing[@]} -gt 0 ] || return 0
  if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
      as_root=(sudo)
    else
      fail "needs root or sudo once, to run: apt-get install --no-install-recommends ${missing[*]}"
    fi
  fi
  say "installing ${#missing[@]} packages and what they depend on: ${missing[*]}"
  as_root+=(env DEBIAN_FRONTEND=noninteractive)
  logged apt-update "${as_root[@]}" "${apt[@]}" update || fail "apt-get update failed"
  logged apt-install "${as_root[@]}" "${apt[@]}" install --no-install-recommends "${missing[@]}" ||
    fail "apt-get install failed"
}

check_tools() {
  local tool
  for tool in c++ cmake ninja git python3; do
    command -v "$tool" >/dev/null || fail "no $tool here; raybench needs $needed"
  done
}

# build/venv with the pinned packages; made anew when these, Python or the folder changed.
make_venv() {
  local python=python3 stamp=$build/venv/stamp state
  [ "$installs" = no ] || python=/usr/bin/python3
  state=$("$python" -VV && cat "$root/reports/requirements.txt" && echo "$root") || fail "cannot run $python"
  [ "$(cat "$stamp" 2>/dev/null)" != "$state" ] || return 0
  say "making the Python environment build/venv"
  rm -rf "$build/venv"
  logged venv "$python" -m venv "$build/venv" || fail "cannot make a virtual environment with $python"
  logged pip "$build/venv/bin/python" -m pip install --disable-pip-version-check --no-input \
    -r "$root/reports/requirements.txt" || fail "pip could not install reports/requirements.txt"
  # lets "build/venv/bin/python -m raybench_report" find the package
  echo "$root/reports" >"$("$build/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/raybench.pth"
  # takes seconds, once
  logged page "$build/venv/bin/python" -c 'from raybench_report import page; page.library()' ||
    fail "cannot put the script of report pages together"
  printf '%s\n' "$state" >"$stamp"
}

# As many jobs as processors, but no more than one for every 2 GB of memory.
job_count() {
  local cpus kib limit jobs
  cpus=$(nproc)
  kib=$(awk '/^MemAvailable:/ {print $2}' /proc/meminfo)
  limit=$(cat /sys/fs/cgroup/memory.max 2>/dev/null || true)
  [[ ! $limit =~ ^[0-9]{1,15}$ ]] || [ $((limit / 1024)) -ge "$kib" ] || kib=$((limit / 1024))
  jobs=$((kib / 2000000))
  [ "$jobs" -le "$cpus" ] || jobs=$cpus
  [ "$jobs" -ge 1 ] || jobs=1
  echo "$jobs"
}

# Configures (when needed) and builds one CMake preset: TARGET, or everything.
build_preset() {
  local preset=$1 target=${2:-all}
  if [ ! "$build/$preset/build.ninja" -nt "$root/CMakePresets.json" ]; then
    say "configuring build/$preset"
    (cd "$root" && logged "configure-$preset" cmake --preset "$preset") || fail "CMake failed; raybench needs $needed"
  fi
  say "building build/$preset with $jobs jobs"
  # gtest_discover_tests runs the tests at build time: no leak check there, it needs ptrace
  (cd "$root" && ASAN_OPTIONS=detect_leaks=0 cmake --build --preset "$preset" --target "$target" -j "$jobs" </dev/null) || exit 1
}

mkdir -p "$build"
installs=no
if [ -z "${RAYBENCH_NO_INSTALL:-}" ] && is_supported_debian; then
  installs=yes
  install_packages
else
  check_tools
fi
jobs=$(job_count)
make_venv
