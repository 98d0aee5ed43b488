#include "gltf_document.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "json_file.h"
#include "mpc/core/error.h"
#include "mpc/core/log.h"
#include "mpc/io/atomic_file.h"

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kGlbHeaderBytes = 12;
constexpr size_t kChunkHeaderBytes = 8;
// Accessors without a buffer view hold zeros: nothing in the file bounds their size.
constexpr std::uint64_t kMaxCountWithoutView = 1 << 22;

bool IsGlb(const std::string& bytes) { return bytes.compare(0, 4, "glTF") == 0; }

std::string_view JsonText(const std::string& bytes, const std::string& source) {
  if (!IsGlb(bytes)) return bytes;
  std::uint32_t length = 0;
  if (bytes.size() >= kGlbHeaderBytes + kChunkHeaderBytes) {
    std::memcpy(&length, bytes.data() + kGlbHeaderBytes, sizeof(length));
  }
  if (length == 0 || length > bytes.size() - kGlbHeaderBytes - kChunkHeaderBytes) {
    throw Error(ErrorCode::kBadFile,
                fmt::format("{}: the JSON chunk of {} bytes does not fit into the file of {} bytes",
                            source, length, bytes.size()));
  }
  return std::string_view(bytes).substr(kGlbHeaderBytes + kChunkHeaderBytes, length);
}

double OptionalNumber(const JsonPlace& place, const char* key, double otherwise) {
  return place.Has(key) ? place[key].Number() : otherwise;
}

// What the parser takes on trust: views within their buffers.
void CheckBufferViews(const JsonPlace& root) {
  if (!root.Has("bufferViews")) return;
  const JsonPlace views = root["bufferViews"];
  for (size_t i = 0; i < views.Size(); ++i) {
    const int buffer = views[i]["buffer"].Int();
    if (buffer < 0) views[i].Fail(fmt::format("has buffer {}", buffer));
    const double available = root["buffers"][static_cast<size_t>(buffer)]["byteLength"].Number();
    const double offset = OptionalNumber(views[i], "byteOffset", 0);
    const double length = views[i]["byteLength"].Number();
    if (offset < 0 || length < 0 || offset + length > available) {
      views[i].Fail(fmt::format("covers bytes {} to {} of a buffer of {}", offset, offset + length,
                                available));
    }
  }
}

void CheckExtensions(const GltfDocument& document) {
  for (const std::string& name : document.model.extensionsRequired) {
    if (name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression") {
      throw Error(ErrorCode::kUnsupported,
                  fmt::format("{}: meshes compressed with {} cannot be read; export the file "
                              "without compression",
                              document.source, name));
    }
  }
}

// Keeps an external image's bytes as they are; images in buffer views need no copy.
bool KeepImageBytes(tinygltf::Image* image, int, std::string*, std::string*, int, int,
                    const unsigned char* bytes, int size, void*) {
  image->as_is = true;
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

void Parse(const std::string& bytes, const std::filesystem::path& path, GltfDocument* document) {
  if (bytes.size() > std::numeric_limits<std::uint32_t>::max()) {
    document->Fail("the file is larger than 4 GB");
  }
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(KeepImageBytes, nullptr);
  std::string errors;
  std::string warnings;
  const std::string folder = path.parent_path().string();
  const auto size = static_cast<unsigned>(bytes.size());
  bool ok = false;
  try {
    ok = IsGlb(bytes) ? loader.LoadBinaryFromMemory(
                            &document->model, &errors, &warnings,
                            reinterpret_cast<const unsigned char*>(bytes.data()), size, folder)
                      : loader.LoadASCIIFromString(&document->model, &errors, &warnings,
                                                   bytes.data(), size, folder);
  } catch (const std::exception& e) {
    errors = e.what();
  }
  const auto one_line = [](std::string text) {
    while (!text.empty() && text.back() == '\n') text.pop_back();
    for (char& c : text) {
      if (c == '\n') c = ';';
    }
    return text;
  };
  if (!ok) document->Fail(fmt::format("not a readable glTF file: {}", one_line(errors)));
  if (!warnings.empty()) LogWarning(document->source + ": " + one_line(warnings));
}

void LinkNodes(GltfDocument* document) {
  const tinygltf::Model& model = document->model;
  const int num_nodes = static_cast<int>(model.nodes.size());
  document->parent.assign(model.nodes.size(), -1);
  for (int n = 0; n < num_nodes; ++n) {
    const tinygltf::Node& node = model.nodes[n];
    for (const int child : node.children) {
      if (child < 0 || child >= num_nodes) {
        document->Fail(fmt::format("node {} has child {} of {} nodes", n, child, num_nodes));
      }
      if (document->parent[child] >= 0)
        document->Fail(fmt::format("node {} has two parents", child));
      document->parent[child] = n;
    }
    const auto check = [&](const std::vector<double>& values, size_t size, const char* what) {
      if (!values.empty() && values.size() != size) {
        document->Fail(
            fmt::format("node {}: {} has {} numbers, expected {}", n, what, values.size(), size));
      }
    };
    check(node.matrix, 16, "matrix");
    check(node.translation, 3, "translation");
    check(node.rotation, 4, "rotation");
    check(node.scale, 3, "scale");
    if (!node.rotation.empty() && Eigen::Vector4d(node.rotation.data()).norm() < 1e-6) {
      document->Fail(fmt::format("node {} has a rotation of length 0", n));
    }
  }
  // With one parent per node at most, a cycle is a node that is its own ancestor.
  std::vector<int> seen(model.nodes.size(), -1);
  for (int n = 0; n < num_nodes; ++n) {
    for (int a = n; a >= 0 && (seen[a] < 0 || seen[a] == n); a = document->parent[a]) {
      if (seen[a] == n) document->Fail(fmt::format("node {} is its own ancestor", a));
      seen[a] = n;
    }
  }
}

void MarkScene(GltfDocument* document) {
  const tinygltf::Model& model = document->model;
  const int num_nodes = static_cast<int>(model.nodes.size());
  document->in_scene.assign(model.nodes.size(), model.scenes.empty());
  if (model.scenes.empty()) return;
  const int scene = std::max(model.defaultScene, 0);
  if (scene >= static_cast<int>(model.scenes.size())) {
    document->Fail(fmt::format("scene {} of {}", scene, model.scenes.size()));
  }
  std::vector<int> open = model.scenes[scene].nodes;
  while (!open.empty()) {
    const int n = open.back();
    open.pop_back();
    if (n < 0 || n >= num_nodes) document->Fail(fmt::format("a scene has node {}", n));
    if (document->in_scene[n]) continue;
    document->in_scene[n] = true;
    open.insert(open.end(), model.nodes[n].children.begin(), model.nodes[n].children.end());
  }
}

double Component(const unsigned char* bytes, int type, bool normalized) {
  const auto read = [&](auto sample) {
    using Number = decltype(sample);
    std::memcpy(&sample, bytes, sizeof(sample));
    if constexpr (std::is_integral_v<Number>) {
      if (normalized) {
        return std::max(sample / static_cast<double>(std::numeric_limits<Number>::max()), -1.0);
      }
    }
    return static_cast<double>(sample);
  };
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return read(std::int8_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return read(std::uint8_t{});
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return read(std::int16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return read(std::uint16_t{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return read(std::uint32_t{});
    default:
      return read(float{});
  }
}

// A run of elements inside a buffer view.
struct Elements {
  const unsigned char* data = nullptr;
  size_t stride = 0;
};

Elements ElementsOf(const GltfDocument& document, int view_index, std::uint64_t offset,
                    std::uint64_t count, std::uint64_t element_bytes, bool tight,
                    const std::string& what) {
  const tinygltf::Model& model = document.model;
  if (view_index < 0 || view_index >= static_cast<int>(model.bufferViews.size())) {
    document.Fail(
        fmt::format("{} has buffer view {} of {}", what, view_index, model.bufferViews.size()));
  }
  const tinygltf::BufferView& view = model.bufferViews[view_index];
  if (view.buffer < 0 || view.buffer >= static_cast<int>(model.buffers.size()) ||
      view.byteOffset > model.buffers[view.buffer].data.size() ||
      view.byteLength > model.buffers[view.buffer].data.size() - view.byteOffset) {
    document.Fail(fmt::format("buffer view {} lies outside of its buffer", view_index));
  }
  const std::uint64_t stride = tight || view.byteStride == 0 ? element_bytes : view.byteStride;
  if (stride < element_bytes || stride > 252) {
    document.Fail(fmt::format("buffer view {} has a stride of {} bytes", view_index, stride));
  }
  constexpr std::uint64_t kMaxCount = std::uint64_t{1} << 32;
  if (count > kMaxCount || offset > view.byteLength ||
      (count > 0 && (count - 1) * stride + element_bytes > view.byteLength - offset)) {
    document.Fail(
        fmt::format("{}: {} elements of {} bytes from byte {} do not fit into the {} "
                    "bytes of buffer view {}",
                    what, count, stride, offset, view.byteLength, view_index));
  }
  return {model.buffers[view.buffer].data.data() + view.byteOffset + offset, stride};
}

}  // namespace

void GltfDocument::Fail(const std::string& fault) const {
  throw Error(ErrorCode::kBadFile, fmt::format("{}: {}", source, fault));
}

Eigen::Affine3d GltfDocument::LocalTransform(int node_index) const {
  const tinygltf::Node& node = model.nodes[node_index];
  Eigen::Affine3d local = Eigen::Affine3d::Identity();
  if (!node.matrix.empty()) {
    local.matrix().topRows<3>() =
        Eigen::Map<const Eigen::Matrix4d>(node.matrix.data()).topRows<3>();
    return local;
  }
  if (!node.translation.empty()) {
    local.translation() = Eigen::Map<const Eigen::Vector3d>(node.translation.data());
  }
  if (!node.rotation.empty()) {
    const Eigen::Quaterniond q(Eigen::Vector4d(node.rotation.data()));
    local.linear() = q.normalized().toRotationMatrix();
  }
  if (!node.scale.empty()) {
    local.linear() *= Eigen::Map<const Eigen::Vector3d>(node.scale.data()).asDiagonal();
  }
  return local;
}

Eigen::Affine3d GltfDocument::WorldTransform(int node) const {
  Eigen::Affine3d world = LocalTransform(node);
  for (int n = parent[node]; n >= 0; n = parent[n]) world = LocalTransform(n) * world;
  return world;
}

Eigen::MatrixXd GltfDocument::ReadAccessor(int index, int num_components,
                                           const std::string& what) const {
  if (index < 0 || index >= static_cast<int>(model.accessors.size())) {
    Fail(fmt::format("{} has accessor {} of {}", what, index, model.accessors.size()));
  }
  const tinygltf::Accessor& accessor = model.accessors[index];
  const int component_bytes =
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType));
  if (tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type)) !=
          num_components ||
      component_bytes < 1 || component_bytes > 4 ||
      accessor.componentType == TINYGLTF_COMPONENT_TYPE_INT) {
    Fail(fmt::format("{}: accessor {} has type {} and component type {}, expected {} components",
                     what, index, accessor.type, accessor.componentType, num_components));
  }
  const auto element_bytes = static_cast<std::uint64_t>(component_bytes * num_components);
  const std::uint64_t count = accessor.count;
  const auto read = [&](const unsigned char* element, Eigen::Ref<Eigen::VectorXd> out) {
    for (int c = 0; c < num_components; ++c) {
      out[c] =
          Component(element + c * component_bytes, accessor.componentType, accessor.normalized);
    }
  };

  Eigen::MatrixXd values;
  if (accessor.bufferView >= 0) {
    const Elements elements = ElementsOf(*this, accessor.bufferView, accessor.byteOffset, count,
                                         element_bytes, /*tight=*/false, what);
    values.resize(num_components, static_cast<Eigen::Index>(count));
    for (Eigen::Index i = 0; i < values.cols(); ++i) {
      read(elements.data + static_cast<size_t>(i) * elements.stride, values.col(i));
    }
  } else {
    if (count > kMaxCountWithoutView)
      Fail(fmt::format("{}: {} elements without data", what, count));
    values.setZero(num_components, static_cast<Eigen::Index>(count));
  }
  if (accessor.sparse.isSparse) {
    const auto& sparse = accessor.sparse;
    const int index_bytes =
        tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(sparse.indices.componentType));
    if (sparse.count < 0 || sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0 ||
        index_bytes < 1 || index_bytes > 4) {
      Fail(fmt::format("{}: accessor {} has a broken sparse part", what, index));
    }
    const auto num_sparse = static_cast<std::uint64_t>(sparse.count);
    const Elements indices = ElementsOf(*this, sparse.indices.bufferView,
                                        static_cast<std::uint64_t>(sparse.indices.byteOffset),
                                        num_sparse, static_cast<std::uint64_t>(index_bytes),
                                        /*tight=*/true, what);
    const Elements replacements =
        ElementsOf(*this, sparse.values.bufferView,
                   static_cast<std::uint64_t>(sparse.values.byteOffset), num_sparse, element_bytes,
                   /*tight=*/true, what);
    for (size_t i = 0; i < num_sparse; ++i) {
      const double at =
          Component(indices.data + i * indices.stride, sparse.indices.componentType, false);
      if (!(at >= 0) || at >= static_cast<double>(count)) {
        Fail(fmt::format("{}: sparse index {} of {} elements", what, at, count));
      }
      read(replacements.data + i * replacements.stride, values.col(static_cast<Eigen::Index>(at)));
    }
  }
  if (!values.allFinite()) Fail(fmt::format("{}: a number is not finite", what));
  return values;
}

GltfDocument LoadGltf(const std::filesystem::path& path) {
  GltfDocument document;
  document.source = path.string();
  const std::string bytes = ReadFile(path);
  document.json = ParseJson(JsonText(bytes, document.source), document.source);
  CheckBufferViews(JsonPlace(document.json, document.source));
  Parse(bytes, path, &document);
  CheckExtensions(document);
  LinkNodes(&document);
  MarkScene(&document);
  return document;
}

}  // namespace mpc::internal
