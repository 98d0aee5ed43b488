// Purpose: a whole performance with exact truth: poses, vertices, camera, joints, detections, and the
// pictures and masks of every frame.
// Source: ours (docs/synthetic.md).
// Frames: world, y up, floor at y = 0. Units: metres, radians, seconds, pixels.
// Symbols: N dofs, V vertices, J joints, F frames.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "mpc/core/progress.h"
#include "mpc/eval/synthetic.h"
#include "mpc/eval/synthetic_camera.h"
#include "mpc/eval/synthetic_scene.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

enum class DetectionErrors {
  kOff,       // no detections at all
  kExact,     // the truth
  kWhite,     // 5 px and 60 mm, a tenth outliers, a fifth not seen
  kMeasured,  // as a network's: DetectionNoise::MeasuredWithFailures
};
inline constexpr std::array<DetectionErrors, 4> kAllDetectionErrors = {
    DetectionErrors::kOff, DetectionErrors::kExact, DetectionErrors::kWhite,
    DetectionErrors::kMeasured};

// Short lower-case name, such as "measured".
std::string_view DetectionErrorsName(DetectionErrors errors);

struct PerformanceOptions {
  SyntheticCameraOptions camera;
  SceneOptions scene;
  DetectionErrors errors = DetectionErrors::kMeasured;
  uint64_t seed = 1;  // of the detections

  // Throws Error (kInvalidArgument) naming the faults.
  void Validate() const;
};

// What is acted.
struct Acting {
  double fps = 30;
  Eigen::MatrixXd poses;                   // N x F, world
  std::vector<Eigen::Matrix3Xf> vertices;  // F times 3xV in the character's order, world
  std::optional<Stool> stool;              // that the actor sits on
};

// Poses and the vertices that plain skinning gives them, shifted along y so that the feet stand on
// the floor: the lowest vertex is below it in a fifth of the frames. The result does not depend on
// num_threads.
Acting ActWithSkinning(const Character& character, const Eigen::MatrixXd& poses, double fps,
                       int num_threads = 0);

// Everything about a performance but its pictures.
struct SyntheticPerformance {
  PerformanceOptions options;
  Acting acting;
  SyntheticCamera camera;
  Eigen::MatrixXd joints;          // 3J x F, the 16, world
  SyntheticDetections detections;  // without frames for kOff

  int num_frames() const { return static_cast<int>(acting.vertices.size()); }
};

// Throws Error (kInvalidArgument): options; poses and vertices that do not fit the character.
SyntheticPerformance MakePerformance(const Character& character, Acting acting,
                                     const PerformanceOptions& options);

// The place around the performance; throws as SyntheticScene.
std::unique_ptr<SyntheticScene> MakeScene(const SyntheticPerformance& performance,
                                          const RigAsset& rig, const Character& character);

struct RenderedFrame {
  int index = 0;
  cv::Mat bgr;   // CV_8UC3
  cv::Mat mask;  // CV_8UC1, 255 where the actor is seen
};

// Renders all frames and hands them over in order, from the calling thread. `progress` (stage "clip")
// may be empty; when it returns false rendering stops. Returns whether all frames were made. The
// pictures do not depend on num_threads.
bool RenderPerformance(const SyntheticPerformance& performance, const SyntheticScene& scene,
                       int num_threads, const std::function<void(const RenderedFrame&)>& sink,
                       const ProgressCallback& progress = {});

}  // namespace mpc
