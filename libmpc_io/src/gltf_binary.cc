#include "gltf_binary.h"

#include <fmt/format.h>

#include <limits>
#include <string>
#include <vector>

#include "gltf_document.h"
#include "mpc/core/error.h"

namespace mpc::internal {
namespace {

using Json = GltfBinary::Json;

constexpr std::uint64_t kMaxGlbBytes = std::numeric_limits<std::uint32_t>::max();

void AddBounds(const Eigen::MatrixXf& values, Json* accessor) {
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    (*accessor)["min"].push_back(values.row(i).minCoeff());
    (*accessor)["max"].push_back(values.row(i).maxCoeff());
  }
}

}  // namespace

// Makes both lists now: adding a member later would move the others in memory.
GltfBinary::GltfBinary(const std::filesystem::path& path, Json* json)
    : path_(path), json_(json), file_(path) {
  for (const char* list : {"accessors", "bufferViews"}) {
    if (!json->contains(list)) (*json)[list] = Json::array();
  }
  stream_.open(file_.temporary(),
               std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
  Check(stream_.is_open(), "the folder takes no file");
}

void GltfBinary::Check(bool ok, const char* what) const {
  if (ok) return;
  throw Error(ErrorCode::kWriteFailed,
              fmt::format("cannot write {}: {} ({} bytes written)", path_.string(), what, size_));
}

std::uint64_t GltfBinary::Append(std::span<const unsigned char> data) {
  static constexpr char kZeros[4] = {};
  const std::uint64_t begin = (size_ + 3) / 4 * 4;
  if (begin + data.size() > kMaxGlbBytes) {
    throw Error(ErrorCode::kUnsupported,
                fmt::format("{} would be larger than 4 GB, the most a .glb can hold: write the "
                            "surface with fewer morph targets",
                            path_.string()));
  }
  stream_.write(kZeros, static_cast<std::streamsize>(begin - size_));
  stream_.write(reinterpret_cast<const char*>(data.data()),
                static_cast<std::streamsize>(data.size()));
  Check(stream_.good(), "is the disk full?");
  size_ = begin + data.size();
  return begin;
}

int GltfBinary::ViewFrom(std::uint64_t begin, int target) {
  Json view = {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", size_ - begin}};
  if (target != 0) view["target"] = target;
  (*json_)["bufferViews"].push_back(std::move(view));
  return static_cast<int>((*json_)["bufferViews"].size()) - 1;
}

int GltfBinary::AddView(std::span<const unsigned char> data, int target) {
  return ViewFrom(Append(data), target);
}

void GltfBinary::Adopt(Json* view, std::span<const unsigned char> data) {
  (*view)["buffer"] = 0;
  (*view)["byteOffset"] = Append(data);
  (*view)["byteLength"] = data.size();
}

int GltfBinary::AddJson(Json accessor) {
  (*json_)["accessors"].push_back(std::move(accessor));
  return static_cast<int>((*json_)["accessors"].size()) - 1;
}

int GltfBinary::AddAccessor(const Eigen::MatrixXf& values, const char* type, int target,
                            bool with_bounds) {
  const int view = AddView(BytesOf(values.data(), static_cast<size_t>(values.size())), target);
  Json accessor = {{"bufferView", view},
                   {"componentType", TINYGLTF_COMPONENT_TYPE_FLOAT},
                   {"count", values.cols()},
                   {"type", type}};
  if (with_bounds) AddBounds(values, &accessor);
  return AddJson(std::move(accessor));
}

int GltfBinary::AddMostlyZero(const Eigen::Matrix3Xf& values) {
  std::vector<std::uint32_t> indices;
  for (Eigen::Index v = 0; v < values.cols(); ++v) {
    if (!values.col(v).isZero(0)) indices.push_back(static_cast<std::uint32_t>(v));
  }
  const bool is_short = values.cols() <= 1 << 16;
  const size_t sparse_bytes = indices.size() * (3 * sizeof(float) + (is_short ? 2 : 4));
  if (sparse_bytes >= static_cast<size_t>(values.size()) * sizeof(float)) {
    return AddAccessor(values, "VEC3", TINYGLTF_TARGET_ARRAY_BUFFER, /*with_bounds=*/true);
  }
  Json accessor = {
      {"componentType", TINYGLTF_COMPONENT_TYPE_FLOAT}, {"count", values.cols()}, {"type", "VEC3"}};
  if (!indices.empty()) {
    const std::vector<std::uint16_t> short_indices(indices.begin(), indices.end());
    const int index_view = AddView(is_short ? BytesOf(short_indices.data(), short_indices.size())
                                            : BytesOf(indices.data(), indices.size()));
    Eigen::Matrix3Xf listed(3, indices.size());
    for (size_t i = 0; i < indices.size(); ++i) {
      listed.col(static_cast<Eigen::Index>(i)) = values.col(indices[i]);
    }
    const int value_view = AddView(BytesOf(listed.data(), static_cast<size_t>(listed.size())));
    accessor["sparse"] = {{"count", indices.size()},
                          {"indices",
                           {{"bufferView", index_view},
                            {"componentType", is_short ? TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT
                                                       : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT}}},
                          {"values", {{"bufferView", value_view}}}};
  }
  AddBounds(values, &accessor);
  return AddJson(std::move(accessor));
}

void GltfBinary::Finish() {
  Append({});  // up to a multiple of 4
  (*json_)["buffers"] = Json::array({{{"byteLength", size_}}});
  std::string text = json_->dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::uint64_t total = 12 + 8 + text.size() + 8 + size_;
  if (total > kMaxGlbBytes) Append({});
  std::string head = "glTF";
  const auto append_number = [&](std::uint64_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    head.append(reinterpret_cast<const char*>(&number), sizeof(number));
  };
  append_number(2);
  append_number(total);
  append_number(text.size());
  head += "JSON" + text;
  append_number(size_);
  head += std::string("BIN\0", 4);

  AtomicFile glb(path_);
  std::ofstream out(glb.temporary(), std::ios::binary | std::ios::trunc);
  out << head;
  stream_.seekg(0);
  if (size_ > 0) out << stream_.rdbuf();
  out.close();
  Check(stream_.good() && out.good(), "is the disk full?");
  glb.Commit();
}

}  // namespace mpc::internal
