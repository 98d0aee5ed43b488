// Purpose: minimum cut of a graph with two terminals, in integers, so that flows are exact.
// Source: Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for
// energy minimization in vision", PAMI 2004: two search trees that are kept between augmentations.
// Written from the paper, on flat arrays.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace mpc {

// Sizes are up to the caller's memory: 40 bytes per node and 24 per edge. Not thread-safe.
class MaxFlow {
 public:
  explicit MaxFlow(int num_nodes);

  // Capacities >= 0, each below 2^30. Calls for the same node add up; their common part flows at
  // once from source to sink.
  void AddTerminals(int node, int32_t from_source, int32_t to_sink);
  // An edge in both directions.
  void AddEdge(int a, int b, int32_t a_to_b, int32_t b_to_a);

  // Value of the maximum flow. Call once, after all edges.
  int64_t Solve();

  // After Solve: whether a node can still be reached from the source. Of all minimum cuts this is
  // the one with the fewest nodes on the source's side.
  bool OnSourceSide(int node) const;
};

}  // namespace mpc
