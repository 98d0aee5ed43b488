// Purpose: a capture folder as input: the posed actor again, and its silhouettes as files.
// Frames: poses in the camera frame. Units: metres. Symbols: N dofs, F frames.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "mpc/core/camera.h"
#include "mpc/core/progress.h"
#include "mpc/silhouettes.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_asset.h"

namespace mpc {

// What a capture found, ready to be posed: ForwardKinematics and SkinCharacter of a column of
// `poses` give the actor in front of the camera.
struct Take {
  std::filesystem::path folder;
  std::filesystem::path video;
  double image_fps = 0;  // of a folder of pictures
  std::filesystem::path actor;
  double fps = 0;
  Camera camera;          // for the video's own resolution
  RigAsset rig;           // with the height and the proportions of the capture
  Character character;    // the same
  Eigen::MatrixXd poses;  // N x F

  PosedClip clip() const {
    return {.video = video,
            .image_fps = image_fps,
            .camera = camera,
            .character = character,
            .poses = poses};
  }
};

// Reads poses.json of a capture folder and the actor it names; `video` and `actor`, where they are
// not empty, are used in place of the recorded paths. Throws Error: kFileNotFound, kBadFile,
// kMismatch for an actor with another skeleton, and what reading the actor throws.
Take ReadTake(const std::filesystem::path& folder, const std::filesystem::path& video = {},
              const std::filesystem::path& actor = {});

struct SegmentOptions {
  SilhouetteOptions silhouettes;
  std::filesystem::path true_masks;  // to compare with; empty: none
  bool pictures = false;             // write masks/000000.png, ...
  bool overlay = true;               // write overlay.mp4: the outline over the video
};

struct SegmentReport {
  bool complete = true;  // false: the progress callback stopped the work
  std::vector<SilhouetteRecord> frames;
  std::vector<std::string> outputs;   // file names inside the output folder
  std::vector<std::string> warnings;  // one sentence each
};

// Writes masks.mp4, what the options ask for and, last, silhouettes.json (docs/formats.md) into
// `output`, which is made when it is missing, each file whole or not at all. Throws Error as
// ExtractSilhouettes, kWriteFailed, and kInvalidArgument when an input would be overwritten.
SegmentReport SegmentTake(const Take& take, const std::filesystem::path& output,
                          const SegmentOptions& options = {},
                          const ProgressCallback& progress = {});

}  // namespace mpc
