#include <fmt/format.h>

#include <algorithm>

#include "gltf_document.h"
#include "mpc/core/log.h"

namespace mpc::internal {
namespace {

constexpr size_t kMaxImageBytes = size_t{256} << 20;

// The bytes of an image; empty with the reason in *fault.
std::vector<unsigned char> ImageBytes(const tinygltf::Model& model, const tinygltf::Image& image,
                                      std::string* fault) {
  if (image.bufferView < 0) {
    if (image.image.empty()) *fault = "its file is not there";
    return image.image;
  }
  if (image.bufferView >= static_cast<int>(model.bufferViews.size())) {
    *fault = fmt::format("it has buffer view {} of {}", image.bufferView, model.bufferViews.size());
    return {};
  }
  const tinygltf::BufferView& view = model.bufferViews[image.bufferView];
  if (view.buffer < 0 || view.buffer >= static_cast<int>(model.buffers.size()) ||
      view.byteOffset > model.buffers[view.buffer].data.size() ||
      view.byteLength > model.buffers[view.buffer].data.size() - view.byteOffset) {
    *fault = fmt::format("buffer view {} lies outside of its buffer", image.bufferView);
    return {};
  }
  if (view.byteLength > kMaxImageBytes) {
    *fault = fmt::format("it has {} bytes, at most {} are read", view.byteLength, kMaxImageBytes);
    return {};
  }
  const auto begin =
      model.buffers[view.buffer].data.begin() + static_cast<std::ptrdiff_t>(view.byteOffset);
  return {begin, begin + static_cast<std::ptrdiff_t>(view.byteLength)};
}

}  // namespace

bool IsEncodedImage(const std::vector<unsigned char>& bytes) {
  static constexpr unsigned char kPng[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  static constexpr unsigned char kJpeg[] = {0xff, 0xd8, 0xff};
  const auto begins = [&bytes](const auto& magic) {
    return bytes.size() > std::size(magic) &&
           std::equal(std::begin(magic), std::end(magic), bytes.begin());
  };
  return begins(kPng) || begins(kJpeg);
}

std::vector<unsigned char> GltfDocument::ReadBaseColour(int material) const {
  if (material < 0 || material >= static_cast<int>(model.materials.size())) return {};
  const tinygltf::TextureInfo& info =
      model.materials[material].pbrMetallicRoughness.baseColorTexture;
  if (info.index < 0) return {};
  std::string fault;
  std::vector<unsigned char> bytes;
  if (info.texCoord != 0) {
    fault = fmt::format("it uses TEXCOORD_{}", info.texCoord);
  } else if (info.index >= static_cast<int>(model.textures.size())) {
    fault = fmt::format("it is texture {} of {}", info.index, model.textures.size());
  } else {
    const int image = model.textures[info.index].source;
    if (image < 0 || image >= static_cast<int>(model.images.size())) {
      fault = fmt::format("it has image {} of {}", image, model.images.size());
    } else {
      bytes = ImageBytes(model, model.images[image], &fault);
      if (fault.empty() && !IsEncodedImage(bytes)) fault = "it is no PNG or JPEG";
    }
  }
  if (fault.empty()) return bytes;
  LogWarning(fmt::format("{}: the base colour texture of material {} is left out: {}", source,
                         material, fault));
  return {};
}

}  // namespace mpc::internal
