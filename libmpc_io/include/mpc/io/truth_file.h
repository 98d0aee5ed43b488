// Purpose: truth.json: what is exactly known about a clip, as synthetic clips come with it
// (docs/formats.md, "Truth of a clip").
// Frames: world of the clip's camera file. Units: metres, pixels, seconds.
// Symbols: F frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace mpc {

struct TruthClip {
  double fps = 0;
  int num_frames = 0;  // F
  int width = 0;       // px
  int height = 0;
  bool has_floor = true;  // the world is y up with the floor at y = 0
  std::string motion;     // how the clip was made; for people
  std::string outfit;
  std::uint64_t seed = 0;
  std::string camera_motion;
  std::string noise;
  // Files; empty: there is none.
  std::filesystem::path video;
  std::filesystem::path actor;         // rigged mesh at rest
  std::filesystem::path camera;        // cameras.json of one camera, moving or not
  std::filesystem::path joints;        // TRC
  std::filesystem::path vertices;      // PC2, in the order of the actor's character
  std::filesystem::path masks;         // folder of pictures: the actor's visible pixels
  std::filesystem::path detections2d;  // what a detector might have seen
  std::filesystem::path detections3d;
};

// `path` is a truth.json or the folder that has one; the clip's files come with that folder's path.
// Throws Error: kFileNotFound, kBadFile naming the place, kUnsupported for another version.
TruthClip ReadTruthClip(const std::filesystem::path& path);

// Writes folder/truth.json; files are named as they are seen from `folder`. Throws Error
// (kWriteFailed).
void WriteTruthClip(const std::filesystem::path& folder, const TruthClip& clip);

}  // namespace mpc
