#!/usr/bin/env bash
# The whole way on a fresh machine: installs what is missing, builds, makes a clip with exact ground
# truth, captures it with the ordinary command and prints the errors. With real data at hand
# (MPC_DATA, else ../shared/data) it captures a real clip too.
#
#   scripts/demo.sh [FOLDER]   results go to FOLDER, default demo_out
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-demo_out}
build=build/demo  # its own: without tests, which need more packages
data=${MPC_DATA:-../shared/data}

scripts/setup.sh --build
cmake --preset release -B "$build" -DMPC_BUILD_TESTS=OFF
cmake --build "$build" -j "$(nproc)" --target monoperfcap
monoperfcap=$build/apps/monoperfcap

echo "== A synthetic clip: the actor walks"
"$monoperfcap" synth -o "$out/synth"
"$monoperfcap" actor info "$out/synth/actor.glb"
detections=()  # none: the networks find the joints in the video
if ! scripts/get_models.sh; then
  echo "demo.sh: NO NETWORKS: detections are synthesised instead, with errors as a network's" >&2
  detections=(--detections2d "$out/synth/detections2d.json"
    --detections3d "$out/synth/detections3d.json")
fi
"$monoperfcap" capture "$out/synth/clip.mp4" --actor "$out/synth/actor.glb" \
  --camera "$out/synth/camera.json" "${detections[@]}" -o "$out/synth/take"
"$monoperfcap" eval "$out/synth/take/joints.trc" --truth "$out/synth/truth.trc"

clip=$data/pose2sim
if [ -d "$clip" ]; then
  echo "== A real clip: a man on a beam, detections of OpenPose and BlazePose"
  "$monoperfcap" capture "$clip/cam01.mp4" --actor "$data/actors/male_tpose.glb" \
    --camera "$clip/cameras.json:cam01" --detections2d "$clip/cam01_openpose_body25b.json" \
    --detections3d "$clip/cam01_blazepose.json" -o "$out/cam01"
  "$monoperfcap" eval "$out/cam01/joints.trc" --truth "$clip/gt_joints.json"
else
  echo "No real data in $data (set MPC_DATA): the real clip is left out."
fi
echo "Results are in $out: open performance.glb in Blender, overlay.mp4 in any player."
