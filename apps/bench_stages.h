// Purpose: the rows of the ablation: what each stage of the method gives for a clip.
// Source: paper, Results, "Evaluation of Algorithmic Components".
// Frames: poses in the camera frame. Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench_suite.h"
#include "mpc/skeleton/character.h"

namespace monoperfcap {

struct StageOutput {
  mpc::Character character;  // with the proportions that the stage found
  Eigen::MatrixXd poses;     // N x F
  // Vertices of a frame, of a stage that deforms the surface; empty: the skinned character.
  std::function<void(int, Eigen::Matrix3Xf*)> vertices;
  double error_2d_mm = 20;  // PoseTrack::error_2d_mm, of stages that measure it
  double seconds = 0;       // of processor time, all threads together, from the detections on
  // The surface of a stage that went on to it; it is another stage's result.
  std::shared_ptr<const std::vector<Eigen::Matrix3Xf>> surface;  // F times 3xV
  double surface_seconds = 0;                                    // more than `seconds`
};

using StageOutputs = std::map<std::string, StageOutput>;  // by key, of the stages before

struct Stage {
  const char* key;
  const char* name;
  const char* improves;  // the stage whose result it starts from and should not make worse, or ""
  // Incomplete when the user interrupted.
  StageOutput (*run)(const BenchClip& clip, const StageOutputs& before);
};

// In the order of the table.
std::span<const Stage> Stages();

}  // namespace monoperfcap
