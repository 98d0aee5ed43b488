#include "mpc/seg/max_flow.h"

#include <algorithm>
#include <limits>

#include "mpc/core/error.h"

namespace mpc {
namespace {

// Values of Node::parent that are not an arc.
constexpr int32_t kNone = -1;
constexpr int32_t kTerminal = -2;
constexpr int32_t kOrphan = -3;

constexpr int32_t kInfinity = std::numeric_limits<int32_t>::max();

}  // namespace

MaxFlow::MaxFlow(int num_nodes) : nodes_(static_cast<size_t>(std::max(0, num_nodes))) {
  edges_.reserve(2 * nodes_.size());  // of a grid with four neighbours
}

void MaxFlow::AddTerminals(int node, int32_t from_source, int32_t to_sink) {
  Node& n = nodes_[node];
  // What the node could already pass on: from the source when positive, to the sink when negative.
  const int64_t source = std::max<int64_t>(n.terminal, 0) + from_source;
  const int64_t sink = std::max<int64_t>(-n.terminal, 0) + to_sink;
  flow_ += std::min(source, sink);
  n.terminal = source - sink;
}

void MaxFlow::AddEdge(int a, int b, int32_t a_to_b, int32_t b_to_a) {
  if (a != b && (a_to_b > 0 || b_to_a > 0)) edges_.push_back({a, b, a_to_b, b_to_a});
}

void MaxFlow::BuildArcs() {
  for (const Edge& e : edges_) {
    ++nodes_[e.a].arc_end;
    ++nodes_[e.b].arc_end;
  }
  int32_t begin = 0;
  for (Node& n : nodes_) {
    n.arc_begin = begin;
    begin += n.arc_end;
    n.arc_end = n.arc_begin;
  }
  arcs_.resize(2 * edges_.size());
  for (const Edge& e : edges_) {
    const int32_t forward = nodes_[e.a].arc_end++;
    const int32_t backward = nodes_[e.b].arc_end++;
    arcs_[forward] = {e.b, backward, e.a_to_b};
    arcs_[backward] = {e.a, forward, e.b_to_a};
  }
  edges_ = {};
}

void MaxFlow::Activate(int32_t node) {
  if (!nodes_[node].active) {
    nodes_[node].active = true;
    active_.push_back(node);
  }
}

int64_t MaxFlow::Solve() {
  BuildArcs();
  for (int32_t i = 0; i < static_cast<int32_t>(nodes_.size()); ++i) {
    Node& n = nodes_[i];
    if (n.terminal == 0) continue;
    n.tree = n.terminal > 0 ? Tree::kSource : Tree::kSink;
    n.parent = kTerminal;
    n.distance = 1;
    Activate(i);
  }
  // The active nodes are a queue; its finished front is dropped now and then.
  size_t front = 0;
  while (front < active_.size()) {
    const int32_t node = active_[front];
    int32_t bridge = kNone;
    if (nodes_[node].tree != Tree::kFree) bridge = Grow(node);
    if (bridge == kNone) {
      nodes_[node].active = false;
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
  return flow_;
}

// Lets the tree of `node` take its free neighbours. Returns an arc from the source's tree to the
// sink's over which flow can pass, or kNone when the node has no more to do.
int32_t MaxFlow::Grow(int32_t node) {
  const Node p = nodes_[node];
  const bool source = p.tree == Tree::kSource;
  for (int32_t a = p.arc_begin; a < p.arc_end; ++a) {
    const Arc& arc = arcs_[a];
    if ((source ? arc.capacity : arcs_[arc.sister].capacity) == 0) continue;
    Node& q = nodes_[arc.head];
    if (q.tree == Tree::kFree) {
      q.tree = p.tree;
      q.parent = arc.sister;
      q.stamp = p.stamp;
      q.distance = p.distance + 1;
      Activate(arc.head);
    } else if (q.tree != p.tree) {
      return source ? a : arc.sister;
    } else if (q.stamp <= p.stamp && q.distance > p.distance + 1) {
      q.parent = arc.sister;  // a shorter way to the terminal
      q.stamp = p.stamp;
      q.distance = p.distance + 1;
    }
  }
  return kNone;
}

// Sends as much as possible from the source over `bridge` to the sink. Nodes whose arc to their
// parent is used up become orphans.
void MaxFlow::Augment(int32_t bridge) {
  const int32_t tail = arcs_[arcs_[bridge].sister].head;
  const int32_t head = arcs_[bridge].head;

  // A node's parent arc points at the parent; in the source's tree flow runs against it.
  int64_t amount = arcs_[bridge].capacity;
  int32_t i = tail;
  for (; nodes_[i].parent != kTerminal; i = arcs_[nodes_[i].parent].head) {
    amount = std::min<int64_t>(amount, arcs_[arcs_[nodes_[i].parent].sister].capacity);
  }
  amount = std::min(amount, nodes_[i].terminal);
  for (i = head; nodes_[i].parent != kTerminal; i = arcs_[nodes_[i].parent].head) {
    amount = std::min<int64_t>(amount, arcs_[nodes_[i].parent].capacity);
  }
  amount = std::min(amount, -nodes_[i].terminal);

  const auto flow = static_cast<int32_t>(amount);
  const auto make_orphan = [this](int32_t node) {
    nodes_[node].parent = kOrphan;
    orphans_.push_back(node);
  };
  arcs_[bridge].capacity -= flow;
  arcs_[arcs_[bridge].sister].capacity += flow;
  for (i = tail; nodes_[i].parent != kTerminal;) {
    Arc& up = arcs_[nodes_[i].parent];
    const int32_t child = i;
    up.capacity += flow;
    arcs_[up.sister].capacity -= flow;
    i = up.head;
    if (arcs_[up.sister].capacity == 0) make_orphan(child);
  }
  nodes_[i].terminal -= flow;
  if (nodes_[i].terminal == 0) make_orphan(i);
  for (i = head; nodes_[i].parent != kTerminal;) {
    Arc& up = arcs_[nodes_[i].parent];
    const int32_t child = i;
    up.capacity -= flow;
    arcs_[up.sister].capacity += flow;
    i = up.head;
    if (up.capacity == 0) make_orphan(child);
  }
  nodes_[i].terminal += flow;
  if (nodes_[i].terminal == 0) make_orphan(i);
  flow_ += flow;
}

// Length of the way from `node` to its terminal, kInfinity when it ends at an orphan. Marks the way
// with the present time, so that it is not walked again in this round.
int32_t MaxFlow::DistanceToTerminal(int32_t node) {
  int32_t steps = 0;
  int32_t i = node;
  int32_t distance = 0;
  for (;; ++steps) {
    Node& n = nodes_[i];
    if (n.stamp == time_) {
      distance = steps + n.distance;
      break;
    }
    if (n.parent == kTerminal) {
      n.stamp = time_;
      n.distance = 1;
      distance = steps + 1;
      break;
    }
    if (n.parent == kOrphan) return kInfinity;
    i = arcs_[n.parent].head;
  }
  int32_t d = distance;
  for (i = node; nodes_[i].stamp != time_; i = arcs_[nodes_[i].parent].head) {
    nodes_[i].stamp = time_;
    nodes_[i].distance = d--;
  }
  return distance;
}

// Finds every orphan a new parent in its tree, or sets it and in turn its children free.
void MaxFlow::Adopt() {
  while (!orphans_.empty()) {
    const int32_t node = orphans_.back();
    orphans_.pop_back();
    Node& p = nodes_[node];
    const bool source = p.tree == Tree::kSource;
    const auto can_feed = [&](const Arc& arc) {
      return (source ? arcs_[arc.sister].capacity : arc.capacity) > 0;
    };

    int32_t best = kInfinity;
    int32_t parent = kNone;
    for (int32_t a = p.arc_begin; a < p.arc_end; ++a) {
      const Arc& arc = arcs_[a];
      if (nodes_[arc.head].tree != p.tree || !can_feed(arc)) continue;
      const int32_t distance = DistanceToTerminal(arc.head);
      if (distance < best) {
        best = distance;
        parent = a;
      }
    }
    if (parent != kNone) {
      p.parent = parent;
      p.stamp = time_;
      p.distance = best + 1;
      continue;
    }
    for (int32_t a = p.arc_begin; a < p.arc_end; ++a) {
      const Arc& arc = arcs_[a];
      Node& q = nodes_[arc.head];
      if (q.tree != p.tree) continue;
      if (can_feed(arc)) Activate(arc.head);
      if (q.parent == arc.sister) {
        q.parent = kOrphan;
        orphans_.push_back(arc.head);
      }
    }
    p.tree = Tree::kFree;
    p.parent = kNone;
  }
}

bool MaxFlow::OnSourceSide(int node) const { return nodes_[node].tree == Tree::kSource; }

}  // namespace mpc
