#!/usr/bin/env bash
# Installs what building and testing need, on Debian 12 or a relative with the same packages.
# Does nothing, and needs no rights, when everything is there.
#
#   scripts/setup.sh           all of it, with what only the tests use
#   scripts/setup.sh --build   only what building and running needs
set -euo pipefail
cd "$(dirname "$0")/.."

build_packages=(
  g++ cmake ninja-build
  libeigen3-dev libceres-dev libopenmesh-dev libopencv-dev libtinygltf-dev libfmt-dev nlohmann-json3-dev
  libcli11-dev
  libavcodec-dev libavformat-dev
  ffmpeg
  npm  # scripts/get_models.sh
)
test_packages=(
  ca-certificates ccache libgtest-dev libgmock-dev libbenchmark-dev clang-format-14
  blender nodejs
  python3-numpy                 # Blender's glTF importer, the metrics once more in Python
  python3-scipy python3-h5py    # scripts/convert_dataset.py
)
gltf_validator=gltf-validator@2.0.0-dev.3.10

packages=("${build_packages[@]}")
case "${1:-}" in
  "") packages+=("${test_packages[@]}") ;;
  --build) ;;
  *)
    echo "usage: $0 [--build]" >&2
    exit 2
    ;;
esac

# As a package, or as a command from elsewhere.
is_installed() {
  command -v "$1" >/dev/null ||
    [ "$(dpkg-query --show --showformat='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "setup.sh: this system has no apt-get. Install the equivalents of these Debian 12 packages:" \
    "${packages[*]}" >&2
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  is_installed "$package" || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  echo "setup.sh: installing ${missing[*]}"
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null; then
      echo "setup.sh: needs root or sudo to run: apt-get install ${missing[*]}" >&2
      exit 1
    fi
    as_root=(sudo)
  fi
  "${as_root[@]}" apt-get update -q
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -q -y --no-install-recommends "${missing[@]}"
fi

# The Khronos glTF validator, for the tests that check written files with it.
if [ $# -eq 0 ] && [ ! -d build/tools/node_modules/gltf-validator ]; then
  npm install --silent --no-audit --no-fund --prefix build/tools "$gltf_validator" ||
    echo "setup.sh: WARNING: npm could not install $gltf_validator; its tests will be skipped" >&2
fi
