// Purpose: distances along the edges of a mesh from one vertex, nearest vertices first (Dijkstra).
// Units: metres. Symbols: V vertices.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

#include "mpc/core/triangle_mesh.h"

namespace mpc {

class EdgeDistances {
 public:
  EdgeDistances(const Eigen::Matrix3Xf& positions, const Triangles& triangles);

  // Calls visit(vertex, source's index, distance) for every vertex that the sources reach, by
  // increasing distance, until it returns false. Not thread-safe.
  template <typename Visit>
  void Walk(const std::vector<int>& sources, Visit visit);

 private:
  struct Step {
    float distance;
    int vertex;
    int source;
    bool operator>(const Step& other) const {
      return std::pair(distance, vertex) > std::pair(other.distance, other.vertex);
    }
  };
  std::vector<int> begin_;  // V+1
  std::vector<std::pair<int, float>> edges_;
  std::vector<float> best_;  // V; infinite where the walk has not been
  std::vector<char> done_;   // V
};

template <typename Visit>
void EdgeDistances::Walk(const std::vector<int>& sources, Visit visit) {
  constexpr float kFar = std::numeric_limits<float>::infinity();
  std::priority_queue<Step, std::vector<Step>, std::greater<>> queue;
  std::vector<int> touched;
  const auto reach = [&](int vertex, float distance, int source) {
    if (distance >= best_[vertex]) return;
    if (best_[vertex] == kFar) touched.push_back(vertex);
    best_[vertex] = distance;
    queue.push({distance, vertex, source});
  };
  for (int s = 0; s < static_cast<int>(sources.size()); ++s) reach(sources[s], 0, s);
  while (!queue.empty()) {
    const Step step = queue.top();
    queue.pop();
    if (done_[step.vertex]) continue;
    done_[step.vertex] = 1;
    if (!visit(step.vertex, step.source, step.distance)) break;
    for (int e = begin_[step.vertex]; e < begin_[step.vertex + 1]; ++e) {
      reach(edges_[e].first, step.distance + edges_[e].second, step.source);
    }
  }
  for (const int v : touched) {
    best_[v] = kFar;
    done_[v] = 0;
  }
}

}  // namespace mpc
