#include "evaluation.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <span>

#include "mpc/core/error.h"
#include "mpc/core/thread_pool.h"
#include "mpc/core/units.h"
#include "mpc/eval/surface_metrics.h"
#include "mpc/io/camera_file.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/pc2.h"
#include "mpc/io/truth_file.h"
#include "mpc/render/model_mask.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"

namespace monoperfcap {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitY();

bool Has(std::span<const mpc::JointId> joints, mpc::JointId joint) {
  return std::find(joints.begin(), joints.end(), joint) != joints.end();
}

// The joints to score, at least one.
std::vector<mpc::JointId> ScoredJoints(JointSet set, std::span<const mpc::JointId> estimate,
                                       std::span<const mpc::JointId> truth,
                                       const Evaluation& evaluation) {
  const std::span<const mpc::JointId> wanted =
      set == JointSet::k14 ? mpc::ScoredJoints14() : estimate;
  std::vector<mpc::JointId> joints;
  for (const mpc::JointId joint : wanted) {
    if (Has(estimate, joint) && Has(truth, joint)) joints.push_back(joint);
  }
  if (joints.empty()) {
    throw mpc::Error(mpc::ErrorCode::kMismatch,
                     fmt::format("{} and {} have none of the joints to score in common",
                                 evaluation.estimate, evaluation.truth));
  }
  return joints;
}

// The limbs, whose lengths no pose changes.
std::vector<mpc::JointPair> Limbs() {
  using mpc::JointId;
  std::vector<mpc::JointPair> limbs = {{JointId::kLeftShoulder, JointId::kLeftElbow},
                                       {JointId::kLeftElbow, JointId::kLeftWrist},
                                       {JointId::kLeftHip, JointId::kLeftKnee},
                                       {JointId::kLeftKnee, JointId::kLeftAnkle},
                                       {JointId::kLeftAnkle, JointId::kLeftToe}};
  for (size_t i = 0; i < 5; ++i) {
    limbs.push_back({mpc::MirrorJoint(limbs[i].a), mpc::MirrorJoint(limbs[i].b)});
  }
  return limbs;
}

// Joint trajectories with another frame's transform per column.
template <typename Transform>
Eigen::MatrixXd Transformed(const Eigen::MatrixXd& trajectories, const Transform& transform) {
  Eigen::MatrixXd result(trajectories.rows(), trajectories.cols());
  for (Index f = 0; f < trajectories.cols(); ++f) {
    const auto to_from = transform(static_cast<int>(f));
    for (Index row = 0; row < trajectories.rows(); row += 3) {
      result.col(f).segment<3>(row) = to_from * trajectories.col(f).segment<3>(row);
    }
  }
  return result;
}

// Where a perfect detector would see the true joints.
mpc::Detections2d ProjectTruth(const mpc::Camera& camera, std::span<const mpc::JointId> joints,
                               const Eigen::MatrixXd& truth_in_camera) {
  mpc::Detections2d detections;
  detections.joints.assign(joints.begin(), joints.end());
  for (Index f = 0; f < truth_in_camera.cols(); ++f) {
    mpc::Detections2d::Frame frame{Eigen::Matrix2Xd::Zero(2, joints.size()),
                                   Eigen::VectorXd::Zero(joints.size())};
    for (Index i = 0; i < frame.confidence.size(); ++i) {
      const Eigen::Vector3d x = truth_in_camera.col(f).segment<3>(3 * i);
      Eigen::Vector2d pixel;
      if (!x.allFinite() || !mpc::Project(camera, x, &pixel)) continue;
      frame.pixels.col(i) = pixel;
      frame.confidence[i] = 1;
    }
    detections.frames.push_back(frame);
  }
  return detections;
}

// The metrics of joints alone: what is aligned per frame in any frame of reference, motion in the
// world. All 3J x F.
void ScoreJoints(const Eigen::MatrixXd& estimate, const Eigen::MatrixXd& truth,
                 const Eigen::MatrixXd& estimate_in_world, const Eigen::MatrixXd& truth_in_world,
                 Evaluation* evaluation) {
  evaluation->errors = mpc::CompareJoints(evaluation->joints, estimate, truth);
  evaluation->jitter = mpc::Jitter(estimate_in_world, evaluation->fps);
  evaluation->truth_jitter = mpc::Jitter(truth_in_world, evaluation->fps);
  evaluation->acceleration =
      mpc::AccelerationError(estimate_in_world, truth_in_world, evaluation->fps);
  evaluation->bones = mpc::CompareBoneLengths(evaluation->joints, estimate, Limbs());
}

void RequireFrames(const std::string& estimate, int estimate_frames, const std::string& truth,
                   int truth_frames) {
  if (estimate_frames == truth_frames) return;
  throw mpc::Error(mpc::ErrorCode::kMismatch, fmt::format("{} has {} frames, {} has {}", estimate,
                                                          estimate_frames, truth, truth_frames));
}

// Both passes over the vertices of a clip: the translation, then the distances.
class SurfaceScoring {
 public:
  SurfaceScoring(const Performance& performance, const Truth& truth,
                 const EvaluationOptions& options)
      : performance_(performance), truth_(truth), options_(options), reader_(truth.vertices) {}

  int num_vertices() const { return reader_.num_vertices(); }
  int num_frames() const { return reader_.num_frames(); }

  SurfaceScores Run(const std::function<void(int)>& one_frame_done) {
    const int num_frames = reader_.num_frames();
    Eigen::Matrix3Xd offsets(3, num_frames);
    mpc::ParallelFor(num_frames, options_.num_threads, [&](int f) {
      Eigen::Matrix3Xf estimate, truth;
      Read(f, &estimate, &truth);
      offsets.col(f) = mpc::MeanOffset(estimate, truth);
    });
    SurfaceScores scores{.translation = offsets.rowwise().mean(),
                         .vertex_mm = Eigen::VectorXd(num_frames),
                         .surface_mm = {}};
    if (options_.surface_distance) scores.surface_mm.resize(num_frames);
    const int group = 4 * mpc::ResolveNumThreads(options_.num_threads);
    for (int begin = 0; begin < num_frames; begin += group) {
      const int count = std::min(group, num_frames - begin);
      mpc::ParallelFor(count, options_.num_threads, [&](int i) {
        Eigen::Matrix3Xf estimate, truth;
        Read(begin + i, &estimate, &truth);
        if (options_.surface_distance) {
          const mpc::SurfaceError error = mpc::CompareSurfaces(
              estimate, truth, performance_.character.mesh.triangles, scores.translation);
          scores.vertex_mm[begin + i] = error.vertex_mm;
          scores.surface_mm[begin + i] = error.surface_mm;
        } else {
          scores.vertex_mm[begin + i] =
              mpc::MeanVertexDistanceMm(estimate, truth, scores.translation);
        }
      });
      one_frame_done(begin + count);
    }
    return scores;
  }

 private:
  // Both in the camera frame.
  void Read(int f, Eigen::Matrix3Xf* estimate, Eigen::Matrix3Xf* truth) {
    PoseVertices(performance_, f, estimate);
    {
      const std::scoped_lock lock(mutex_);
      reader_.Read(f, truth);
    }
    const mpc::CameraFromWorld place = CameraPlace(performance_, truth_, f);
    const Eigen::Matrix3f rotation = place.rotation.cast<float>();
    *truth = (rotation * *truth).colwise() + place.translation.cast<float>();
  }

  const Performance& performance_;
  const Truth& truth_;
  const EvaluationOptions& options_;
  std::mutex mutex_;
  mpc::Pc2Reader reader_;
};

// One frame of a clip on its way through the mask metrics.
struct MaskWork {
  cv::Mat truth;
  cv::Mat silhouette;
};

MaskScores EmptyScores(int num_frames) {
  return {Eigen::VectorXd::Constant(num_frames, mpc::kNan),
          Eigen::VectorXd::Constant(num_frames, mpc::kNan)};
}

void ScoreMask(const cv::Mat& mask, const cv::Mat& truth, int frame, MaskScores* scores) {
  scores->iou[frame] = mpc::MaskIou(mask, truth);
  scores->boundary_f[frame] = mpc::BoundaryF(mask, truth);
}

void ReadMask(mpc::MaskReader* reader, const fs::path& path, int frame, int num_frames,
              cv::Mat* mask) {
  if (!reader->Read(mask)) RequireFrames(path.string(), frame, "the capture", num_frames);
}

void ScoreMasks(const Performance& performance, const Truth& truth,
                const EvaluationOptions& options, const std::function<void(int)>& frames_done,
                Evaluation* evaluation) {
  const int num_frames = static_cast<int>(performance.poses.cols());
  const int width = performance.camera.width, height = performance.camera.height;
  mpc::MaskReader truths(truth.masks, width, height);
  std::optional<mpc::MaskReader> silhouettes;
  evaluation->model = EmptyScores(num_frames);
  if (!performance.silhouettes.empty()) {
    silhouettes.emplace(performance.silhouettes, width, height);
    evaluation->silhouettes = EmptyScores(num_frames);
  }
  const auto topology = mpc::SurfaceTopology::FromMesh(performance.character.mesh);
  std::vector<MaskWork> work(static_cast<size_t>(2 * mpc::ResolveNumThreads(options.num_threads)));
  for (int begin = 0; begin < num_frames;) {
    const int count = std::min(static_cast<int>(work.size()), num_frames - begin);
    for (int i = 0; i < count; ++i) {
      MaskWork& one = work[static_cast<size_t>(i)];
      ReadMask(&truths, truth.masks, begin + i, num_frames, &one.truth);
      if (silhouettes) {
        ReadMask(&*silhouettes, performance.silhouettes, begin + i, num_frames, &one.silhouette);
      }
    }
    mpc::ParallelFor(count, options.num_threads, [&](int i) {
      const MaskWork& one = work[static_cast<size_t>(i)];
      Eigen::Matrix3Xf vertices;
      PoseVertices(performance, begin + i, &vertices);
      cv::Mat model;
      mpc::ModelMask(performance.camera, vertices, topology, &model);
      ScoreMask(model, one.truth, begin + i, &*evaluation->model);
      if (silhouettes) ScoreMask(one.silhouette, one.truth, begin + i, &*evaluation->silhouettes);
    });
    begin += count;
    frames_done(begin);
  }
  cv::Mat more;
  if (truths.Read(&more)) {
    throw mpc::Error(mpc::ErrorCode::kMismatch,
                     fmt::format("{} has more masks than the capture's {} frames",
                                 truth.masks.string(), num_frames));
  }
}

void ScoreSurface(const Performance& performance, const Truth& truth,
                  const EvaluationOptions& options, const std::function<void(int)>& frames_done,
                  Evaluation* evaluation) {
  SurfaceScoring scoring(performance, truth, options);
  const Index num_vertices = performance.character.mesh.positions.cols();
  if (scoring.num_vertices() != num_vertices) {
    evaluation->skipped.push_back(
        fmt::format("surface error: the capture's mesh has {} vertices, {} has {}: another actor",
                    num_vertices, truth.vertices.string(), scoring.num_vertices()));
    return;
  }
  RequireFrames(performance.name, evaluation->num_frames(), truth.vertices.string(),
                scoring.num_frames());
  evaluation->surface = scoring.Run(frames_done);
}

}  // namespace

Truth ReadTruth(const fs::path& path, const fs::path& true_masks) {
  std::error_code ec;
  const bool is_clip = fs::is_directory(path, ec) || path.filename() == "truth.json";
  Truth truth;
  truth.name = path.string();
  if (is_clip) {
    const mpc::TruthClip clip = mpc::ReadTruthClip(path);
    if (clip.camera.empty() || clip.joints.empty()) {
      throw mpc::Error(mpc::ErrorCode::kBadFile,
                       fmt::format("{} names no camera or no joints", truth.name));
    }
    truth.joints = mpc::ReadJointTrack(clip.joints);
    truth.camera = mpc::ReadCamera(clip.camera.string());
    truth.motion = mpc::ReadCameraMotion(clip.camera.string());
    truth.has_floor = clip.has_floor;
    truth.vertices = clip.vertices;
    truth.masks = clip.masks;
    truth.video = clip.video;
  } else {
    truth.joints = mpc::ReadJointTrack(path);
  }
  if (!true_masks.empty()) truth.masks = true_masks;
  return truth;
}

void PoseVertices(const Performance& performance, int frame, Eigen::Matrix3Xf* vertices) {
  if (performance.vertices) return performance.vertices(frame, vertices);
  mpc::KinematicState state;
  mpc::ForwardKinematics(performance.character.skeleton, performance.poses.col(frame), &state);
  mpc::SkinCharacter(performance.character, state, vertices);
}

mpc::CameraFromWorld CameraPlace(const Performance& performance, const Truth& truth, int frame) {
  if (!truth.motion.empty()) return truth.motion[static_cast<size_t>(frame)];
  return truth.camera ? truth.camera->camera_from_world : performance.camera.camera_from_world;
}

Evaluation EvaluateJoints(const mpc::JointTrack& estimate, const mpc::JointTrack& truth,
                          JointSet joints, const std::string& estimate_name,
                          const std::string& truth_name) {
  RequireFrames(estimate_name, estimate.num_frames(), truth_name, truth.num_frames());
  Evaluation evaluation;
  evaluation.estimate = estimate_name;
  evaluation.truth = truth_name;
  evaluation.fps = estimate.fps;
  evaluation.joints = ScoredJoints(joints, estimate.joints, truth.joints, evaluation);
  const Eigen::MatrixXd estimated =
      mpc::SelectJoints(estimate.positions, estimate.joints, evaluation.joints);
  const Eigen::MatrixXd expected =
      mpc::SelectJoints(truth.positions, truth.joints, evaluation.joints);
  ScoreJoints(estimated, expected, estimated, expected, &evaluation);
  return evaluation;
}

Evaluation Evaluate(const Performance& performance, const Truth& truth,
                    const EvaluationOptions& options, const mpc::ProgressCallback& progress) {
  const int num_frames = static_cast<int>(performance.poses.cols());
  RequireFrames(performance.name, num_frames, truth.name, truth.joints.num_frames());
  if (!truth.motion.empty()) {
    RequireFrames(performance.name, num_frames, "the camera of " + truth.name,
                  static_cast<int>(truth.motion.size()));
  }
  if (!truth.camera && !performance.camera.has_extrinsics) {
    throw mpc::Error(
        mpc::ErrorCode::kMismatch,
        fmt::format("{} was captured with a camera without R and t, so its joints have "
                    "no place in the world of {}",
                    performance.name, truth.name));
  }
  Evaluation evaluation;
  evaluation.estimate = performance.name;
  evaluation.truth = truth.name;
  evaluation.fps = performance.fps;
  std::vector<mpc::JointId> captured;
  for (const mpc::SkeletonJoint& joint : performance.character.skeleton.joints) {
    captured.push_back(joint.id);
  }
  evaluation.joints = ScoredJoints(options.joints, captured, truth.joints.joints, evaluation);

  const auto camera_from_world = [&](int f) { return CameraPlace(performance, truth, f); };
  const auto world_from_camera = [&](int f) { return camera_from_world(f).Inverse(); };
  const Eigen::MatrixXd estimate =
      mpc::SelectJoints(mpc::JointTrajectories(performance.character.skeleton, performance.poses),
                        captured, evaluation.joints);
  const Eigen::MatrixXd expected_in_world =
      mpc::SelectJoints(truth.joints.positions, truth.joints.joints, evaluation.joints);
  const Eigen::MatrixXd expected = Transformed(expected_in_world, camera_from_world);
  const Eigen::MatrixXd estimate_in_world = Transformed(estimate, world_from_camera);
  ScoreJoints(estimate, expected, estimate_in_world, expected_in_world, &evaluation);
  evaluation.reprojection =
      mpc::CompareReprojection(performance.camera, evaluation.joints, estimate,
                               ProjectTruth(performance.camera, evaluation.joints, expected));
  if (truth.has_floor) {
    evaluation.skate = mpc::CompareFootSkate(evaluation.joints, estimate_in_world,
                                             expected_in_world, performance.fps, kUp);
  } else {
    evaluation.skipped.emplace_back("foot skate: the truth knows no floor");
  }

  const auto report = [&](const char* stage) {
    return [&, stage](int done) {
      if (progress && !progress({stage, done, num_frames})) {
        throw mpc::Error(mpc::ErrorCode::kCancelled, "interrupted");
      }
    };
  };
  if (truth.masks.empty()) {
    evaluation.skipped.emplace_back("masks: the truth has none");
  } else {
    ScoreMasks(performance, truth, options, report("masks"), &evaluation);
    if (!evaluation.silhouettes) {
      evaluation.skipped.emplace_back("extracted silhouettes: the capture has none");
    }
  }
  if (truth.vertices.empty()) {
    evaluation.skipped.emplace_back("surface error: the truth has no vertices");
  } else {
    ScoreSurface(performance, truth, options, report("surface"), &evaluation);
  }
  return evaluation;
}

}  // namespace monoperfcap
