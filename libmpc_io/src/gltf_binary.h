// Purpose: the binary chunk of a .glb while it is being written, and the file as a whole.
// The chunk goes to a file beside the output as it grows: memory does not depend on its size.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>

#include "mpc/io/atomic_file.h"

namespace mpc::internal {

class GltfBinary {
 public:
  using Json = nlohmann::ordered_json;

  // `json` is the file's own; accessors and views are added to it. Throws Error (kWriteFailed).
  GltfBinary(const std::filesystem::path& path, Json* json);

  // Adds bytes at the next multiple of 4; returns where. Throws Error (kWriteFailed, and
  // kUnsupported beyond the 4 GB that a .glb can hold).
  std::uint64_t Append(std::span<const unsigned char> data);

  // A view of the bytes from `begin` to the end; returns its index. target: of a vertex attribute.
  int ViewFrom(std::uint64_t begin, int target = 0);
  int AddView(std::span<const unsigned char> data, int target = 0);
  // Moves a view's content into this chunk.
  void Adopt(Json* view, std::span<const unsigned char> data);

  // One column per element; returns the accessor's index.
  int AddAccessor(const Eigen::MatrixXf& values, const char* type, int target, bool with_bounds);
  // Positions (with bounds) that are zero at all but a few vertices: sparse where that is smaller.
  int AddMostlyZero(const Eigen::Matrix3Xf& values);
  int AddJson(Json accessor);

  // Writes the whole file to its place.
  void Finish();

 private:
  void Check(bool ok, const char* what) const;

  std::filesystem::path path_;
  Json* json_;
  AtomicFile file_;
  std::fstream stream_;
  std::uint64_t size_ = 0;
};

template <typename T>
std::span<const unsigned char> BytesOf(const T* data, size_t count) {
  return {reinterpret_cast<const unsigned char*>(data), count * sizeof(T)};
}

}  // namespace mpc::internal
