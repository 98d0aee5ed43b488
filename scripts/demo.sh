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
# Sources compiled in batches: a third of the time when everything is compiled.
cmake --preset release -B "$build" -DMPC_BUILD_TESTS=OFF -DCMAKE_UNITY_BUILD=ON -DMPC_WERROR=OFF
cmake --build "$build" -j "$(nproc)" --target monoperfcap
monoperfcap=$build/apps/monoperfcap

echo "== A synthetic clip: an actor in a skirt walks"
"$monoperfcap" synth -o "$out/synth" --outfit skirt --seconds 3
"$monoperfcap" actor info "$out/synth/actor.glb"
detections=()  # none: the networks find the joints in the video
if ! scripts/get_models.sh; then
  echo "demo.sh: NO NETWORKS: detections are synthesised instead, with errors as a network's" >&2
  detections=(--detections2d "$out/synth/detections2d.json"
    --detections3d "$out/synth/detections3d.json")
fi
"$monoperfcap" capture "$out/synth/clip.mp4" --actor "$out/synth/actor.glb" \
  --camera "$out/synth/camera.json" "${detections[@]}" -o "$out/synth/take"
"$monoperfcap" eval "$out/synth/take" --truth "$out/synth" | tee "$out/synth/evaluation.txt"

clip=$data/pose2sim
if [ -d "$clip" ]; then
  echo "== A real clip: a man on a beam, detections of OpenPose and BlazePose"
  "$monoperfcap" capture "$clip/cam01.mp4" --actor "$data/actors/male_tpose.glb" \
    --camera "$clip/cameras.json:cam01" --detections2d "$clip/cam01_openpose_body25b.json" \
    --detections3d "$clip/cam01_blazepose.json" -o "$out/cam01"
  "$monoperfcap" eval "$out/cam01/joints.trc" --truth "$clip/gt_joints.json" |
    tee "$out/cam01/evaluation.txt"
else
  echo "No real data in $data (set MPC_DATA): the real clip is left out."
fi
errors='^(MPJPE|PA-MPJPE|vertex error|IoU  )'
echo "== Done. Errors of the synthetic clip, all of them in $out/synth/evaluation.txt:"
grep -E "$errors" "$out/synth/evaluation.txt"
if [ -d "$clip" ]; then
  echo "Of the real clip, all of them in $out/cam01/evaluation.txt:"
  grep -E "$errors" "$out/cam01/evaluation.txt"
fi
echo "== What to look at:"
echo "  $out/synth/clip.mp4                    the clip, made with exact truth"
echo "  $out/synth/take/overlay.mp4            the captured surface and skeleton over it"
echo "  $out/synth/take/evaluation.html        the errors over time, and the worst frames"
echo "  $out/synth/take/performance.glb        the performance, for Blender and other programs"
if [ -d "$clip" ]; then
  echo "  $out/cam01/overlay.mp4                 the same for the real clip"
fi
