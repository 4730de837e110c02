#!/usr/bin/env bash
# Finds a software Vulkan driver with ray tracing for the tests: lavapipe of Mesa 25 or later. Debian 13's package
# mesa-vulkan-drivers has it; Debian 12's does not, but the one of its backports does, which is unpacked into FOLDER here.
# It is found by the apt configuration that is there, verified by apt, and nothing of the system is changed.
set -euo pipefail

if [ $# != 1 ] || [ "$1" = --help ]; then
  cat <<'USAGE'
usage: .ci/lavapipe.sh FOLDER
Prints the file that VK_DRIVER_FILES shall name. Exit code 1, and one line why, where there is no such driver.
On Debian 12 the packages mesa-vulkan-drivers and libvulkan1 must be installed: the newer driver needs what they need.
USAGE
  exit 2
fi
mkdir -p "$1"
folder=$(cd "$1" && pwd -P)
tried=25.0.7-2~bpo12+1 # with libllvm15; another version is taken, and said

fail() {
  printf 'lavapipe.sh: %s\n' "$*" >&2
  exit 1
}

# Installed already, and new enough?
version=$(dpkg-query -W -f='${Version}' mesa-vulkan-drivers 2>/dev/null) ||
  fail "the package mesa-vulkan-drivers is not installed"
if dpkg --compare-versions "$version" ge 25; then
  for file in /usr/share/vulkan/icd.d/lvp_icd*.json; do
    [ ! -r "$file" ] || { echo "$file"; exit 0; }
  done
  fail "mesa-vulkan-drivers $version brings no lavapipe"
fi

file=$folder/lvp_icd.json
if [ -r "$file" ]; then
  echo "$file"
  exit 0
fi

# An apt of its own, which knows the backports of the mirror that the system uses.
apt=$folder/apt
mkdir -p "$apt/etc" "$apt/lists/partial" "$apt/archives/partial" "$folder/root"
# shellcheck disable=SC1091
codename=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
# shellcheck disable=SC2016 # apt expands these
mirror=$(apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' |
  awk -v release="$codename" '$1 == release {print $2; exit}')
[ -n "$mirror" ] || fail "apt knows no mirror of $codename"
cat >"$apt/etc/backports.sources" <<SOURCES
Types: deb
URIs: $mirror
Suites: $codename-backports
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
SOURCES
options=(-q -o "Dir::Etc::SourceList=$apt/etc/backports.sources" -o Dir::Etc::SourceParts=/dev/null
  -o "Dir::State::Lists=$apt/lists" -o "Dir::Cache=$apt" -o APT::Sandbox::User=root -o Acquire::Retries=3)
log=$folder/lavapipe.log
apt-get "${options[@]}" update >"$log" 2>&1 || fail "the backports of $codename cannot be reached; see $log"
candidate=$(apt-cache "${options[@]}" madison mesa-vulkan-drivers | awk -F' *[|] *' 'NR == 1 {print $2}')
[ -n "$candidate" ] || fail "the backports of $codename have no mesa-vulkan-drivers"
[ "$candidate" = "$tried" ] || printf 'lavapipe.sh: takes version %s; %s was tried\n' "$candidate" "$tried" >&2
(cd "$apt" && apt-get "${options[@]}" download "mesa-vulkan-drivers=$candidate") >>"$log" 2>&1 ||
  fail "mesa-vulkan-drivers $candidate cannot be downloaded; see $log"
dpkg-deb -x "$apt"/mesa-vulkan-drivers_*.deb "$folder/root"
library=$(find "$folder/root" -name libvulkan_lvp.so)
[ -n "$library" ] || fail "mesa-vulkan-drivers $candidate brings no lavapipe"
missing=$(ldd "$library" | awk '/not found/ {print $1}')
[ -z "$missing" ] || fail "lavapipe $candidate lacks ${missing//$'\n'/, }"
rm -rf "$apt"
printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.4.305"}}\n' "$library" >"$file.new"
mv "$file.new" "$file"
echo "$file"
