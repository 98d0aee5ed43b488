// Purpose: minimum cut of a grid of nodes between two terminals, in integers, so that flows are exact.
// Source: Boykov and Kolmogorov, "An experimental comparison of min-cut/max-flow algorithms for
// energy minimization in vision", PAMI 2004: two search trees that are kept between augmentations.
// Written from the paper for nodes that have their few links beside them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace mpc {

// Every node has up to kDegree links, one per direction: direction d's opposite is d ^ 1. Links are as strong
// both ways. Not thread-safe.
template <size_t kDegree>
class GridFlow {
 public:
  explicit GridFlow(size_t num_nodes) { nodes_.reserve(1 + num_nodes); }

  // Returns its number, from 1 on. `surplus`: what the source can send it (> 0) or the sink take from
  // it (< 0). With all its links, and those with its neighbours' surpluses, below 2^31.
  int32_t AddNode(int32_t surplus) {
    nodes_.emplace_back().surplus = surplus;
    return static_cast<int32_t>(nodes_.size()) - 1;
  }
  void AddSurplus(int32_t node, int32_t surplus) {
    nodes_[static_cast<size_t>(node)].surplus += surplus;
  }
  // Node b lies in `direction` of node a; each once. Capacity 0 to 2^30.
  void Link(int32_t a, size_t direction, int32_t b, int32_t capacity) {
    Node& from = nodes_[static_cast<size_t>(a)];
    Node& to = nodes_[static_cast<size_t>(b)];
    from.neighbour[direction] = b;
    to.neighbour[direction ^ 1] = a;
    from.capacity[direction] = to.capacity[direction ^ 1] = capacity;
  }

  // Decides nodes that no choice of their neighbours could turn, which may decide those in turn, and the
  // others by the maximum flow, which begins between neighbours. Call once, after all links. Returns how
  // many needed the flow.
  int Solve();

  // After Solve. Of all minimum cuts this is the one with the fewest nodes on the source's side.
  bool OnSourceSide(int32_t node) const {
    return nodes_[static_cast<size_t>(node)].tree == Tree::kSource;
  }

 private:
  enum class Tree : uint8_t { kFree, kSource, kSink };
  struct Node {
    std::array<int32_t, kDegree> neighbour{};  // 0: none
    std::array<int32_t, kDegree> capacity{};   // what the link to it can still carry
    int32_t surplus = 0;
    int32_t stamp = 0;      // when `distance` was known to be right
    int32_t distance = 0;   // to the terminal, in links
    int8_t parent = kNone;  // direction, or why there is none
    Tree tree = Tree::kFree;
    bool active = false;
    bool decided = false;
  };
  // Values of Node::parent that are no direction.
  static constexpr int8_t kNone = -1;
  static constexpr int8_t kTerminal = -2;
  static constexpr int8_t kOrphan = -3;

  // From a node of the source's tree to one of the sink's.
  struct Bridge {
    int32_t tail = -1;  // -1: there is none
    size_t direction = 0;
  };

  Node& Neighbour(const Node& node, size_t direction) {
    return nodes_[static_cast<size_t>(node.neighbour[direction])];
  }
  // The direction of its parent, of a node that has one.
  static size_t ToParent(const Node& node) { return static_cast<uint8_t>(node.parent); }
  Node& Parent(const Node& node) { return Neighbour(node, ToParent(node)); }

  static bool IsCertain(const Node& node);
  void DecideFrom(int32_t node);
  void PassOn(Node* node);
  void Activate(int32_t node);
  Bridge Grow(int32_t node);
  void Augment(const Bridge& bridge);
  void MakeOrphan(Node* node);
  void Adopt();
  int32_t DistanceToTerminal(Node* node);

  std::vector<Node> nodes_{1};    // the first stands for no neighbour
  std::vector<int32_t> pending_;  // nodes that a neighbour's decision may have decided
  std::vector<int32_t> active_;
  std::vector<int32_t> orphans_;
  int32_t time_ = 0;
};

}  // namespace mpc
