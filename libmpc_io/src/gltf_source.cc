#include "gltf_source.h"

#include <cstring>
#include <iterator>
#include <set>
#include <span>
#include <string>
#include <string_view>

namespace mpc::internal {
namespace {

using Json = nlohmann::ordered_json;

// Every reference of the JSON to an accessor, animations left out.
template <typename Visit>
void ForEachAccessorReference(Json* json, const Visit& visit) {
  const auto visit_all = [&](Json& attributes) {
    for (Json& accessor : attributes) visit(accessor);
  };
  if (json->contains("meshes")) {
    for (Json& mesh : (*json)["meshes"]) {
      for (Json& primitive : mesh["primitives"]) {
        visit_all(primitive["attributes"]);
        if (primitive.contains("indices")) visit(primitive["indices"]);
        if (!primitive.contains("targets")) continue;
        for (Json& target : primitive["targets"]) visit_all(target);
      }
    }
  }
  if (json->contains("skins")) {
    for (Json& skin : (*json)["skins"]) {
      if (skin.contains("inverseBindMatrices")) visit(skin["inverseBindMatrices"]);
    }
  }
}

template <typename Visit>
void ForEachViewReference(Json* json, const Visit& visit) {
  if (json->contains("accessors")) {
    for (Json& accessor : (*json)["accessors"]) {
      if (accessor.contains("bufferView")) visit(accessor["bufferView"]);
      if (!accessor.contains("sparse")) continue;
      visit(accessor["sparse"]["indices"]["bufferView"]);
      visit(accessor["sparse"]["values"]["bufferView"]);
    }
  }
  if (json->contains("images")) {
    for (Json& image : (*json)["images"]) {
      if (image.contains("bufferView")) visit(image["bufferView"]);
    }
  }
}

// Removes from `list` the entries of `candidates` that nothing refers to, and renumbers the
// references that for_each visits.
template <typename ForEach>
void RemoveUnused(Json* list, std::set<int> candidates, const ForEach& for_each) {
  for_each([&](Json& index) { candidates.erase(index.get<int>()); });
  for_each([&](Json& index) {
    const int old_index = index.get<int>();
    index = old_index -
            static_cast<int>(std::distance(candidates.begin(), candidates.lower_bound(old_index)));
  });
  for (auto it = candidates.rbegin(); it != candidates.rend(); ++it) {
    list->erase(static_cast<size_t>(*it));
  }
}

std::set<int> AnimationAccessors(const Json& json) {
  std::set<int> accessors;
  for (const Json& animation : json.at("animations")) {
    for (const Json& sampler : animation.at("samplers")) {
      accessors.insert({sampler.at("input").get<int>(), sampler.at("output").get<int>()});
    }
  }
  return accessors;
}

std::string MimeType(std::span<const unsigned char> image) {
  const auto starts_with = [&](std::string_view magic) {
    return image.size() >= magic.size() &&
           std::memcmp(image.data(), magic.data(), magic.size()) == 0;
  };
  if (starts_with("\x89PNG")) return "image/png";
  if (starts_with("RIFF")) return "image/webp";
  if (starts_with("\xABKTX")) return "image/ktx2";
  return "image/jpeg";
}

}  // namespace

void DropAnimations(const GltfDocument& document, Json* json) {
  if (!json->contains("animations")) return;
  const std::set<int> accessors = AnimationAccessors(*json);
  json->erase("animations");
  for (const std::string& extension : document.model.extensionsUsed) {
    if (extension.starts_with("EXT_")) return;
  }
  std::set<int> views;
  for (const int accessor : accessors) {
    if (accessor < 0 || accessor >= static_cast<int>(document.model.accessors.size())) return;
    const int view = document.model.accessors[accessor].bufferView;
    if (view >= 0) views.insert(view);
  }
  RemoveUnused(&(*json)["accessors"], accessors,
               [&](const auto& visit) { ForEachAccessorReference(json, visit); });
  RemoveUnused(&(*json)["bufferViews"], views,
               [&](const auto& visit) { ForEachViewReference(json, visit); });
}

void GatherData(const GltfDocument& document, Json* json, GltfBinary* binary) {
  if (json->contains("bufferViews")) {
    for (Json& view : (*json)["bufferViews"]) {
      const auto& buffer = document.model.buffers[view["buffer"].get<size_t>()].data;
      const auto offset = view.value("byteOffset", size_t{0});
      const auto length = view["byteLength"].get<size_t>();
      if (offset > buffer.size() || length > buffer.size() - offset) {
        document.Fail("a buffer view lies outside of its buffer");
      }
      binary->Adopt(&view, std::span(buffer).subspan(offset, length));
    }
  }
  for (size_t i = 0; i < document.model.images.size(); ++i) {
    const std::vector<unsigned char>& bytes = document.model.images[i].image;
    if (bytes.empty()) continue;
    Json& image = (*json)["images"][i];
    image.erase("uri");
    image["mimeType"] = MimeType(bytes);
    image["bufferView"] = binary->AddView(bytes);
  }
}

}  // namespace mpc::internal
