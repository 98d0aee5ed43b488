#include "mpc/seg/grid_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <random>
#include <vector>

namespace mpc {
namespace {

struct Graph {
  struct Edge {
    int a;
    int b;  // in `direction` of a
    size_t direction;
    int capacity;
  };
  std::vector<int> surplus;
  std::vector<Edge> edges;
};

// Sparse, dense and grid-like graphs, with many zero and equal capacities: every direction leads from some
// nodes to others, no two to the same.
template <size_t kDegree>
Graph RandomGraph(uint32_t seed, int max_nodes = 60) {
  std::mt19937 rng(seed);
  const auto below = [&rng](int n) { return static_cast<int>(rng() % static_cast<unsigned>(n)); };
  const int n = 2 + below(max_nodes - 1);
  const int largest = seed % 3 == 0 ? 3 : 1000;
  Graph graph;
  for (int i = 0; i < n; ++i) {
    graph.surplus.push_back(below(3) == 0 ? below(2 * largest - 1) - largest + 1 : 0);
  }
  std::vector<int> to(static_cast<size_t>(n));
  for (size_t d = 0; d < kDegree; d += 2) {
    std::iota(to.begin(), to.end(), 0);
    if (seed % 2 == 0) {
      std::shuffle(to.begin(), to.end(), rng);
    } else {
      std::rotate(to.begin(), to.begin() + 1 + below(std::min(7, n - 1)), to.end());
    }
    for (int a = 0; a < n; ++a) {
      const int b = to[static_cast<size_t>(a)];
      if (a != b && below(4) > 0) graph.edges.push_back({a, b, d, below(largest)});
    }
  }
  return graph;
}

int64_t CutValue(const Graph& graph, const std::vector<bool>& source_side) {
  int64_t value = 0;
  for (size_t i = 0; i < graph.surplus.size(); ++i) {
    value += std::max(0, source_side[i] ? -graph.surplus[i] : graph.surplus[i]);
  }
  for (const Graph::Edge& e : graph.edges) {
    if (source_side[e.a] != source_side[e.b]) value += e.capacity;
  }
  return value;
}

template <size_t kDegree>
std::vector<bool> SolveOurs(const Graph& graph, int* num_flow_nodes = nullptr) {
  GridFlow<kDegree> flow(graph.surplus.size());
  for (const int surplus : graph.surplus) flow.AddNode(surplus);
  for (const Graph::Edge& e : graph.edges) {
    // Either end may name the link.
    if (e.a % 2 == 0) {
      flow.Link(e.a + 1, e.direction, e.b + 1, e.capacity);
    } else {
      flow.Link(e.b + 1, e.direction ^ 1, e.a + 1, e.capacity);
    }
  }
  const int num_nodes = flow.Solve();
  if (num_flow_nodes != nullptr) *num_flow_nodes = num_nodes;
  std::vector<bool> source_side;
  for (int32_t i = 0; i < static_cast<int32_t>(graph.surplus.size()); ++i) {
    source_side.push_back(flow.OnSourceSide(i + 1));
  }
  return source_side;
}

struct Cut {
  int64_t flow;
  std::vector<bool> source_side;
};

Cut SolveOpenCv(const Graph& graph) {
  cv::detail::GCGraph<int> flow(static_cast<unsigned>(graph.surplus.size()),
                                static_cast<unsigned>(2 * graph.edges.size()));
  for (const int surplus : graph.surplus) {
    flow.addTermWeights(flow.addVtx(), std::max(surplus, 0), std::max(-surplus, 0));
  }
  flow.addEdges(0, 1, 0, 0);  // it refuses graphs without edges
  for (const Graph::Edge& e : graph.edges) flow.addEdges(e.a, e.b, e.capacity, e.capacity);
  Cut cut;
  cut.flow = flow.maxFlow();
  for (size_t i = 0; i < graph.surplus.size(); ++i) {
    cut.source_side.push_back(flow.inSourceSegment(static_cast<int>(i)));
  }
  return cut;
}

// The minimum cut with the fewest nodes on the sink's side: that of the graph turned around.
template <size_t kDegree>
std::vector<bool> LargestSourceSide(Graph graph) {
  for (int& surplus : graph.surplus) surplus = -surplus;
  std::vector<bool> side = SolveOurs<kDegree>(graph);
  side.flip();
  return side;
}

template <size_t kDegree>
void ExpectOpenCvsCuts() {
  int num_unique = 0, num_without_flow = 0;
  for (uint32_t seed = 0; seed < 1000; ++seed) {
    const Graph graph = RandomGraph<kDegree>(seed);
    int num_flow_nodes = 0;
    const std::vector<bool> ours = SolveOurs<kDegree>(graph, &num_flow_nodes);
    const Cut theirs = SolveOpenCv(graph);
    ASSERT_EQ(CutValue(graph, ours), theirs.flow) << "graph " << seed;
    num_without_flow += num_flow_nodes < static_cast<int>(graph.surplus.size()) / 2;
    if (LargestSourceSide<kDegree>(graph) == ours) {  // only one minimum cut
      ASSERT_EQ(ours, theirs.source_side) << "graph " << seed;
      ++num_unique;
    }
  }
  EXPECT_GT(num_unique, 100);
  EXPECT_LT(num_without_flow, 500);
}

TEST(GridFlow, EqualsOpenCvOnThousandGraphsOfFourLinks) { ExpectOpenCvsCuts<4>(); }

TEST(GridFlow, EqualsOpenCvOnThousandGraphsOfEightLinks) { ExpectOpenCvsCuts<8>(); }

TEST(GridFlow, IsTheLeastOfAllCuts) {
  for (uint32_t seed = 0; seed < 300; ++seed) {
    const Graph graph = RandomGraph<4>(seed, 10);
    const size_t n = graph.surplus.size();
    int64_t least = CutValue(graph, std::vector<bool>(n, false));
    std::ptrdiff_t fewest = 0;  // nodes on the source's side among the least cuts
    for (uint32_t bits = 1; bits < (1U << n); ++bits) {
      std::vector<bool> side(n);
      for (size_t i = 0; i < n; ++i) side[i] = (bits >> i & 1) != 0;
      const int64_t value = CutValue(graph, side);
      const std::ptrdiff_t size = std::count(side.begin(), side.end(), true);
      if (value < least || (value == least && size < fewest)) {
        least = value;
        fewest = size;
      }
    }
    const std::vector<bool> ours = SolveOurs<4>(graph);
    EXPECT_EQ(CutValue(graph, ours), least) << "graph " << seed;
    EXPECT_EQ(std::count(ours.begin(), ours.end(), true), fewest) << "graph " << seed;
  }
}

TEST(GridFlow, DecidesWhatNeedsNoFlow) {
  // The first node is certain, and makes the second so, and that the third.
  int num_flow_nodes = -1;
  const Graph row = {{10, -1, -1}, {{0, 1, 0, 4}, {1, 2, 0, 2}}};
  EXPECT_EQ(SolveOurs<4>(row, &num_flow_nodes), std::vector<bool>({true, true, true}));
  EXPECT_EQ(num_flow_nodes, 0);
  const Graph tied = {{3, -3}, {{0, 1, 0, 3}}};
  EXPECT_EQ(SolveOurs<4>(tied, &num_flow_nodes), std::vector<bool>({false, false}));
  EXPECT_EQ(num_flow_nodes, 2);
}

TEST(GridFlow, GraphsWithoutLinksOrNodes) {
  EXPECT_EQ(GridFlow<4>(0).Solve(), 0);
  EXPECT_EQ(SolveOurs<8>({{2, -5, 0}, {}}), std::vector<bool>({true, false, false}));
}

TEST(GridFlow, CapacitiesNearTheirLimit) {
  constexpr int kLarge = (1 << 30) - 1;
  // The narrowest place is the last link.
  const Graph row = {{kLarge, 0, -kLarge}, {{0, 1, 0, kLarge}, {1, 2, 0, kLarge - 1}}};
  EXPECT_EQ(SolveOurs<4>(row), std::vector<bool>({true, true, false}));
}

}  // namespace
}  // namespace mpc
