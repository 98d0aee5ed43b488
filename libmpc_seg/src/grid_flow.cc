#include "mpc/seg/grid_flow.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>

namespace mpc {

template <size_t kDegree>
int GridFlow<kDegree>::Solve() {
  const auto num_nodes = static_cast<int32_t>(nodes_.size());
  for (int32_t i = 1; i < num_nodes; ++i) {
    if (IsCertain(nodes_[static_cast<size_t>(i)])) DecideFrom(i);
  }
  for (int32_t i = 1; i < num_nodes; ++i) PassOn(&nodes_[static_cast<size_t>(i)]);
  int num_undecided = 0;
  for (int32_t i = 1; i < num_nodes; ++i) {
    Node& node = nodes_[static_cast<size_t>(i)];
    if (node.decided) continue;
    ++num_undecided;
    if (node.surplus == 0) continue;
    node.tree = node.surplus > 0 ? Tree::kSource : Tree::kSink;
    node.parent = kTerminal;
    node.distance = 1;
    Activate(i);
  }
  // The active nodes are a queue; its finished front is dropped now and then.
  size_t front = 0;
  while (front < active_.size()) {
    const int32_t i = active_[front];
    Node& node = nodes_[static_cast<size_t>(i)];
    Bridge bridge;
    if (node.tree != Tree::kFree) bridge = Grow(i);
    if (bridge.tail < 0) {
      node.active = false;
      if (++front == active_.size()) {
        active_.clear();
        front = 0;
      }
      continue;
    }
    ++time_;
    Augment(bridge);
    Adopt();
  }
  return num_undecided;
}

template <size_t kDegree>
bool GridFlow<kDegree>::IsCertain(const Node& node) {
  int32_t links = 0;
  for (const int32_t capacity : node.capacity) links += capacity;
  return std::abs(node.surplus) > links && !node.decided;
}

// A decided node's links become a part of its neighbours' surpluses.
template <size_t kDegree>
void GridFlow<kDegree>::DecideFrom(int32_t first) {
  pending_.push_back(first);
  while (!pending_.empty()) {
    Node& node = nodes_[static_cast<size_t>(pending_.back())];
    pending_.pop_back();
    if (node.decided) continue;
    node.decided = true;
    node.tree = node.surplus > 0 ? Tree::kSource : Tree::kSink;
    for (size_t d = 0; d < kDegree; ++d) {
      const int32_t link = std::exchange(node.capacity[d], 0);
      if (link == 0) continue;
      Node& other = Neighbour(node, d);
      other.capacity[d ^ 1] = 0;
      other.surplus += node.surplus > 0 ? link : -link;
      if (IsCertain(other)) pending_.push_back(node.neighbour[d]);
    }
  }
}

// Sends surplus to neighbours that can take it: the shortest of all ways, without a search.
template <size_t kDegree>
void GridFlow<kDegree>::PassOn(Node* node) {
  for (size_t d = 0; d < kDegree && node->surplus > 0; ++d) {
    Node& other = Neighbour(*node, d);
    const int32_t flow = std::min({node->surplus, node->capacity[d], -other.surplus});
    if (flow <= 0) continue;
    node->surplus -= flow;
    node->capacity[d] -= flow;
    other.surplus += flow;
    other.capacity[d ^ 1] += flow;
  }
}

template <size_t kDegree>
void GridFlow<kDegree>::Activate(int32_t i) {
  Node& node = nodes_[static_cast<size_t>(i)];
  if (node.active) return;
  node.active = true;
  active_.push_back(i);
}

// Lets the tree of a node take its free neighbours. Returns a bridge over which flow can pass, or none
// when the node has no more to do.
template <size_t kDegree>
typename GridFlow<kDegree>::Bridge GridFlow<kDegree>::Grow(int32_t i) {
  const Node& p = nodes_[static_cast<size_t>(i)];
  const bool source = p.tree == Tree::kSource;
  for (size_t d = 0; d < kDegree; ++d) {
    if (source && p.capacity[d] == 0) continue;
    Node& q = Neighbour(p, d);
    if (!source && q.capacity[d ^ 1] == 0) continue;
    if (q.tree == Tree::kFree) {
      q.tree = p.tree;
      q.parent = static_cast<int8_t>(d ^ 1);
      q.stamp = p.stamp;
      q.distance = p.distance + 1;
      Activate(p.neighbour[d]);
    } else if (q.tree != p.tree) {
      return source ? Bridge{i, d} : Bridge{p.neighbour[d], d ^ 1};
    } else if (q.stamp <= p.stamp && q.distance > p.distance + 1) {
      q.parent = static_cast<int8_t>(d ^ 1);  // a shorter way to the terminal
      q.stamp = p.stamp;
      q.distance = p.distance + 1;
    }
  }
  return {};
}

// Sends as much as possible from the source over the bridge to the sink. Nodes whose link to their
// parent is used up become orphans.
template <size_t kDegree>
void GridFlow<kDegree>::Augment(const Bridge& bridge) {
  Node& tail = nodes_[static_cast<size_t>(bridge.tail)];
  Node& head = Neighbour(tail, bridge.direction);
  // In the source's tree flow runs from the parent, in the sink's to it.
  int32_t flow = tail.capacity[bridge.direction];
  Node* node = &tail;
  for (; node->parent != kTerminal; node = &Parent(*node)) {
    flow = std::min(flow, Parent(*node).capacity[ToParent(*node) ^ 1]);
  }
  flow = std::min(flow, node->surplus);
  for (node = &head; node->parent != kTerminal; node = &Parent(*node)) {
    flow = std::min(flow, node->capacity[ToParent(*node)]);
  }
  flow = std::min(flow, -node->surplus);

  tail.capacity[bridge.direction] -= flow;
  head.capacity[bridge.direction ^ 1] += flow;
  for (node = &tail; node->parent != kTerminal;) {
    const size_t up = ToParent(*node);
    Node& parent = Neighbour(*node, up);
    node->capacity[up] += flow;
    parent.capacity[up ^ 1] -= flow;
    if (parent.capacity[up ^ 1] == 0) MakeOrphan(node);
    node = &parent;
  }
  node->surplus -= flow;
  if (node->surplus == 0) MakeOrphan(node);
  for (node = &head; node->parent != kTerminal;) {
    const size_t up = ToParent(*node);
    Node& parent = Neighbour(*node, up);
    node->capacity[up] -= flow;
    parent.capacity[up ^ 1] += flow;
    if (node->capacity[up] == 0) MakeOrphan(node);
    node = &parent;
  }
  node->surplus += flow;
  if (node->surplus == 0) MakeOrphan(node);
}

template <size_t kDegree>
void GridFlow<kDegree>::MakeOrphan(Node* node) {
  node->parent = kOrphan;
  orphans_.push_back(static_cast<int32_t>(node - nodes_.data()));
}

// Length of the way from a node to its terminal; the largest number when it ends at an orphan. Marks the
// way with the present time, so that it is not walked again in this round.
template <size_t kDegree>
int32_t GridFlow<kDegree>::DistanceToTerminal(Node* node) {
  int32_t distance = 0;
  for (Node* i = node;; i = &Parent(*i)) {
    if (i->stamp == time_) {
      distance += i->distance;
      break;
    }
    if (i->parent == kOrphan) return std::numeric_limits<int32_t>::max();
    ++distance;
    if (i->parent == kTerminal) {
      i->stamp = time_;
      i->distance = 1;
      break;
    }
  }
  int32_t d = distance;
  for (Node* i = node; i->stamp != time_; i = &Parent(*i)) {
    i->stamp = time_;
    i->distance = d--;
  }
  return distance;
}

// Finds every orphan a new parent in its tree, or sets it and in turn its children free.
template <size_t kDegree>
void GridFlow<kDegree>::Adopt() {
  while (!orphans_.empty()) {
    Node& p = nodes_[static_cast<size_t>(orphans_.back())];
    orphans_.pop_back();
    const bool source = p.tree == Tree::kSource;
    int32_t best = std::numeric_limits<int32_t>::max();
    int8_t parent = kNone;
    // Of its tree, those that flow could come from or go to.
    std::array<Node*, kDegree> feeders{};
    for (size_t d = 0; d < kDegree; ++d) {
      if (!source && p.capacity[d] == 0) continue;
      Node& q = Neighbour(p, d);
      if ((source && q.capacity[d ^ 1] == 0) || q.tree != p.tree) continue;
      feeders[d] = &q;
      const int32_t distance = DistanceToTerminal(&q);
      if (distance < best) {
        best = distance;
        parent = static_cast<int8_t>(d);
      }
    }
    p.parent = parent;
    if (parent != kNone) {
      p.stamp = time_;
      p.distance = best + 1;
      continue;
    }
    for (size_t d = 0; d < kDegree; ++d) {
      Node& q = Neighbour(p, d);
      if (q.tree != p.tree) continue;
      if (feeders[d] != nullptr) Activate(p.neighbour[d]);
      if (q.parent == static_cast<int8_t>(d ^ 1)) MakeOrphan(&q);
    }
    p.tree = Tree::kFree;
  }
}

template class GridFlow<4>;
template class GridFlow<8>;

}  // namespace mpc
