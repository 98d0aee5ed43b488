// Purpose: minimum cut of a graph with two terminals, in integers, so that flows are exact.
// Source: Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for
// energy minimization in vision", PAMI 2004: two search trees that are kept between augmentations.
// Written from the paper, on flat arrays.
#pragma once

#include <cstdint>
#include <vector>

namespace mpc {

// Sizes are up to the caller's memory: 32 bytes per node and 40 per edge. Not thread-safe.
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

 private:
  enum class Tree : uint8_t { kFree, kSource, kSink };
  struct Node {
    int64_t terminal = 0;  // what the source (> 0) can still send or the sink (< 0) still take
    int32_t arc_begin = 0;
    int32_t arc_end = 0;
    int32_t parent = -1;   // arc to the parent, or why there is none
    int32_t stamp = 0;     // when `distance` was known to be right
    int32_t distance = 0;  // to the terminal, in arcs
    Tree tree = Tree::kFree;
    bool active = false;
  };
  struct Arc {
    int32_t head;
    int32_t sister;  // the same edge from the other end
    int32_t capacity;
  };
  struct Edge {
    int32_t a;
    int32_t b;
    int32_t a_to_b;
    int32_t b_to_a;
  };

  void BuildArcs();
  void Activate(int32_t node);
  int32_t Grow(int32_t node);
  void Augment(int32_t bridge);
  void Adopt();
  int32_t DistanceToTerminal(int32_t node);

  std::vector<Node> nodes_;
  std::vector<Edge> edges_;  // until Solve
  std::vector<Arc> arcs_;    // grouped by tail
  std::vector<int32_t> active_;
  std::vector<int32_t> orphans_;
  int32_t time_ = 0;
  int64_t flow_ = 0;
};

}  // namespace mpc
