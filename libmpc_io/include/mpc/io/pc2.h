// Purpose: PC2 point caches: the positions of a mesh's vertices in every frame, as Blender's Mesh
// Cache modifier and other programs read them.
// Source: PointCache2 format: "POINTCACHE2\0", int32 version = 1, int32 V, float32 first frame,
// float32 frames per sample, int32 F, then F times V times x y z, float32; all little-endian.
// Frames: the caller's. Units: metres. Symbols: V vertices, F frames.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>

namespace mpc {

// Writes frame by frame. The file appears at `path` complete, by Close(), or not at all.
class Pc2Writer {
 public:
  // Throws Error: kInvalidArgument for num_vertices < 1, kWriteFailed.
  Pc2Writer(const std::filesystem::path& path, int num_vertices);
  ~Pc2Writer();
  Pc2Writer(Pc2Writer&&) noexcept;
  Pc2Writer& operator=(Pc2Writer&&) noexcept;

  // One frame, 3xV. Throws Error: kMismatch for another V, kInvalidArgument for a position that is
  // not finite, kWriteFailed.
  void Write(const Eigen::Matrix3Xf& positions);

  // Completes the header and moves the file to its place. Throws Error (kWriteFailed).
  void Close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Reads frame by frame, in any order. Not thread-safe.
class Pc2Reader {
 public:
  // Throws Error: kFileNotFound; kBadFile for another kind of file, impossible counts, or a file
  // whose size is not that of its counts.
  explicit Pc2Reader(const std::filesystem::path& path);
  ~Pc2Reader();
  Pc2Reader(Pc2Reader&&) noexcept;
  Pc2Reader& operator=(Pc2Reader&&) noexcept;

  int num_vertices() const;
  int num_frames() const;

  // Frame `frame`, 3xV. Throws Error: kInvalidArgument for a frame outside [0, F), kBadFile for a
  // position that is not finite or a file that cannot be read.
  void Read(int frame, Eigen::Matrix3Xf* positions);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mpc
