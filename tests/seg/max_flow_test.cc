#include "mpc/seg/max_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <random>
#include <vector>

namespace mpc {
namespace {

struct Graph {
  struct Terminal {
    int source;
    int sink;
  };
  struct Edge {
    int a;
    int b;
    int forward;
    int backward;
  };
  std::vector<Terminal> terminals;
  std::vector<Edge> edges;
};

// Sparse, dense and grid-like graphs, with many zero and equal capacities.
Graph RandomGraph(uint32_t seed) {
  std::mt19937 rng(seed);
  const auto below = [&rng](int n) { return static_cast<int>(rng() % static_cast<unsigned>(n)); };
  const int n = 2 + below(60);
  const int largest = seed % 3 == 0 ? 3 : 1000;
  Graph graph;
  for (int i = 0; i < n; ++i) graph.terminals.push_back({0, 0});
  for (Graph::Terminal& t : graph.terminals) {
    if (below(3) == 0) t.source = below(largest);
    if (below(3) == 0) t.sink = below(largest);
  }
  const int num_edges = below(4 * n) + 1;
  for (int e = 0; e < num_edges; ++e) {
    const int a = below(n);
    const int b = seed % 2 == 0 ? below(n) : std::min(n - 1, a + 1 + below(7));
    if (a != b) graph.edges.push_back({a, b, below(largest), below(2) * below(largest)});
  }
  return graph;
}

int64_t CutValue(const Graph& graph, const std::vector<bool>& source_side) {
  int64_t value = 0;
  for (size_t i = 0; i < graph.terminals.size(); ++i) {
    value += source_side[i] ? graph.terminals[i].sink : graph.terminals[i].source;
  }
  for (const Graph::Edge& e : graph.edges) {
    if (source_side[e.a] && !source_side[e.b]) value += e.forward;
    if (source_side[e.b] && !source_side[e.a]) value += e.backward;
  }
  return value;
}

struct Cut {
  int64_t flow;
  std::vector<bool> source_side;
};

Cut SolveOurs(const Graph& graph) {
  MaxFlow flow(static_cast<int>(graph.terminals.size()));
  for (size_t i = 0; i < graph.terminals.size(); ++i) {
    flow.AddTerminals(static_cast<int>(i), graph.terminals[i].source, graph.terminals[i].sink);
  }
  for (const Graph::Edge& e : graph.edges) flow.AddEdge(e.a, e.b, e.forward, e.backward);
  Cut cut;
  cut.flow = flow.Solve();
  for (size_t i = 0; i < graph.terminals.size(); ++i) {
    cut.source_side.push_back(flow.OnSourceSide(static_cast<int>(i)));
  }
  return cut;
}

Cut SolveOpenCv(const Graph& graph) {
  cv::detail::GCGraph<int> flow(static_cast<unsigned>(graph.terminals.size()),
                                static_cast<unsigned>(2 * graph.edges.size()));
  for (const Graph::Terminal& t : graph.terminals) {
    const int node = flow.addVtx();
    flow.addTermWeights(node, t.source, t.sink);
  }
  flow.addEdges(0, 1, 0, 0);  // it refuses graphs without edges
  for (const Graph::Edge& e : graph.edges) flow.addEdges(e.a, e.b, e.forward, e.backward);
  Cut cut;
  cut.flow = flow.maxFlow();
  for (size_t i = 0; i < graph.terminals.size(); ++i) {
    cut.source_side.push_back(flow.inSourceSegment(static_cast<int>(i)));
  }
  return cut;
}

// The minimum cut with the fewest nodes on the sink's side: that of the graph turned around.
std::vector<bool> LargestSourceSide(const Graph& graph) {
  Graph reverse = graph;
  for (Graph::Terminal& t : reverse.terminals) std::swap(t.source, t.sink);
  for (Graph::Edge& e : reverse.edges) std::swap(e.forward, e.backward);
  std::vector<bool> side = SolveOurs(reverse).source_side;
  side.flip();
  return side;
}

TEST(MaxFlow, EqualsOpenCvOnThousandGraphs) {
  int num_unique = 0;
  for (uint32_t seed = 0; seed < 1000; ++seed) {
    const Graph graph = RandomGraph(seed);
    const Cut ours = SolveOurs(graph);
    const Cut theirs = SolveOpenCv(graph);
    ASSERT_EQ(ours.flow, theirs.flow) << "graph " << seed;
    ASSERT_EQ(CutValue(graph, ours.source_side), ours.flow) << "graph " << seed;
    if (LargestSourceSide(graph) == ours.source_side) {  // only one minimum cut
      ASSERT_EQ(ours.source_side, theirs.source_side) << "graph " << seed;
      ++num_unique;
    }
  }
  EXPECT_GT(num_unique, 100);
}

TEST(MaxFlow, IsTheLeastOfAllCuts) {
  for (uint32_t seed = 0; seed < 300; ++seed) {
    Graph graph = RandomGraph(seed);
    const size_t n = std::min<size_t>(graph.terminals.size(), 10);
    graph.terminals.resize(n);
    std::erase_if(graph.edges, [n](const Graph::Edge& e) {
      return e.a >= static_cast<int>(n) || e.b >= static_cast<int>(n);
    });
    int64_t least = CutValue(graph, std::vector<bool>(n, false));
    size_t fewest = 0;  // nodes on the source's side among the least cuts
    for (uint32_t bits = 1; bits < (1U << n); ++bits) {
      std::vector<bool> side(n);
      for (size_t i = 0; i < n; ++i) side[i] = (bits >> i & 1) != 0;
      const int64_t value = CutValue(graph, side);
      const auto size = static_cast<size_t>(std::count(side.begin(), side.end(), true));
      if (value < least || (value == least && size < fewest)) {
        least = value;
        fewest = size;
      }
    }
    const Cut ours = SolveOurs(graph);
    EXPECT_EQ(ours.flow, least) << "graph " << seed;
    EXPECT_EQ(std::count(ours.source_side.begin(), ours.source_side.end(), true), fewest);
  }
}

TEST(MaxFlow, GraphsWithoutEdgesOrNodes) {
  EXPECT_EQ(MaxFlow(0).Solve(), 0);
  MaxFlow lone(2);
  lone.AddTerminals(0, 5, 3);
  lone.AddTerminals(0, 1, 0);
  lone.AddTerminals(1, 2, 7);
  EXPECT_EQ(lone.Solve(), 5);
  EXPECT_TRUE(lone.OnSourceSide(0));
  EXPECT_FALSE(lone.OnSourceSide(1));
}

TEST(MaxFlow, CapacitiesNearTheirLimit) {
  constexpr int32_t kLarge = (1 << 30) - 1;
  MaxFlow flow(3);
  flow.AddTerminals(0, kLarge, 0);
  flow.AddTerminals(2, 0, kLarge);
  flow.AddEdge(0, 1, kLarge, kLarge);
  flow.AddEdge(1, 2, kLarge, kLarge);
  EXPECT_EQ(flow.Solve(), kLarge);
}

}  // namespace
}  // namespace mpc
