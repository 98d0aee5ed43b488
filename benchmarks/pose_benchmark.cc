// Speed of mpc::pose beside plain baselines; names as in README.md.
// The naive baseline of the batch solver takes half a minute and more: it runs only with the
// environment variable MPC_BENCHMARK_NAIVE set.

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "mpc/pose/batch_oracle.h"
#include "mpc/pose/batch_solver.h"
#include "mpc/pose/frame_initializer.h"
#include "pose/autodiff_twin.h"
#include "pose/synthetic_clip.h"

namespace mpc {
namespace {

using testing::FrameIngredients;
using testing::SyntheticBatch;
using testing::Terms;

constexpr int kFrames = 50;
constexpr double kFps = 30;
constexpr double kTolerance = 1e-5;  // relative, of all batch solvers

// Half a walk, started from the frames' own solutions, and the cost that all solvers must reach.
// The bounds are wide enough not to matter: plain Ceres stalls at active ones.
struct Batch {
  explicit Batch(Terms terms)
      : synthetic(testing::MakeBatch(
            testing::MotionInCamera(DefaultSkeleton(), MotionKind::kWalk, kFrames, kFps), kFps,
            terms, 7, /*rest_weight=*/30)) {
    for (Hinge& hinge : synthetic.problem.skeleton.hinges) {
      hinge.min_rad -= 1;
      hinge.max_rad += 1;
    }
    FrameSolveScratch scratch;
    for (int f = 0; f < kFrames; ++f) {
      Eigen::VectorXd pose = synthetic.start.col(f);
      SolveFrame(synthetic.problem.skeleton, synthetic.problem.frames[f], {}, &pose, &scratch);
      synthetic.start.col(f) = pose;
    }
    Eigen::MatrixXd poses = synthetic.start;
    best_cost =
        SolveBatch(synthetic.problem, {.max_iterations = 300, .relative_tolerance = 1e-9}, &poses)
            .final_cost;
  }

  SyntheticBatch synthetic;
  double best_cost = 0;
};

void CheckCost(const Batch& batch, double cost, int iterations, benchmark::State* state) {
  state->counters["iterations"] = iterations;
  state->counters["cost_over_best"] = cost / batch.best_cost;
  if (!(std::abs(cost - batch.best_cost) < 1e-3 * batch.best_cost)) {
    state->SkipWithError("the solution's cost is off by more than 0.1 %");
  }
}

void SolveBatch(benchmark::State& state, Terms terms) {
  const Batch batch(terms);
  SolveSummary summary;
  for (auto _ : state) {
    Eigen::MatrixXd poses = batch.synthetic.start;
    summary = SolveBatch(batch.synthetic.problem,
                         {.max_iterations = 100, .relative_tolerance = kTolerance}, &poses);
  }
  CheckCost(batch, summary.final_cost, summary.iterations, &state);
}
BENCHMARK_CAPTURE(SolveBatch, paper, Terms::kPaper)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(SolveBatch, ours, Terms::kOurs)->Unit(benchmark::kMillisecond);

void SolveBatch_BaselineOracle(benchmark::State& state, Terms terms) {
  const Batch batch(terms);
  SolveSummary summary;
  for (auto _ : state) {
    Eigen::MatrixXd poses = batch.synthetic.start;
    summary = SolveBatchCeres(batch.synthetic.problem, {.relative_tolerance = kTolerance}, &poses);
  }
  CheckCost(batch, summary.final_cost, summary.iterations, &state);
}
BENCHMARK_CAPTURE(SolveBatch_BaselineOracle, paper, Terms::kPaper)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(SolveBatch_BaselineOracle, ours, Terms::kOurs)->Unit(benchmark::kMillisecond);

// The paper's formula put into Ceres as it stands: automatic differentiation everywhere, E_d one
// cost function of all frames with the null space of the basis as a dense matrix.
class NaiveFrameCost {
 public:
  NaiveFrameCost(const SyntheticBatch& batch, const RootChart& chart, int frame)
      : batch_(batch), chart_(chart), frame_(frame) {}

  template <typename T>
  bool operator()(const T* s, T* residuals) const {
    const testing::TwinMatrix3<T> root =
        testing::TwinChartRotation<T>(chart_, Eigen::Map<const testing::TwinVector3<T>>(s + 3));
    const std::vector<T> rows = testing::TwinResiduals<T>(batch_.problem.skeleton, batch_.camera,
                                                          batch_.ingredients[frame_], s, root);
    std::copy(rows.begin(), rows.end(), residuals);
    return true;
  }

 private:
  const SyntheticBatch& batch_;
  const RootChart& chart_;
  int frame_;
};

class NaiveSmoothness {
 public:
  explicit NaiveSmoothness(const BatchProblem& problem)
      : weights_(problem.smoothness.cwiseSqrt()), directions_(kFrames, kFrames) {
    // The shares are the same for every dof here.
    const Eigen::VectorXd shares = problem.band_penalty.row(0);
    directions_ << shares.cwiseSqrt().asDiagonal() * problem.basis, BasisComplement(problem.basis);
  }

  template <typename T>
  bool operator()(T const* const* s, T* residuals) const {
    for (Eigen::Index n = 0; n < weights_.size(); ++n) {
      for (int row = 0; row < kFrames; ++row) {
        T sum(0);
        for (int f = 0; f < kFrames; ++f) sum += s[f][n] * directions_(row, f);
        *residuals++ = weights_[n] * sum;
      }
    }
    return true;
  }

 private:
  Eigen::VectorXd weights_;
  Eigen::MatrixXd directions_;
};

void SolveBatch_BaselineNaive(benchmark::State& state, Terms terms) {
  const Batch batch(terms);
  const BatchProblem& problem = batch.synthetic.problem;
  const int num_dofs = problem.skeleton.num_dofs();
  std::vector<Eigen::Matrix3d> rotations;
  for (int f = 0; f < kFrames; ++f) {
    rotations.push_back(ExpSO3(batch.synthetic.start.col(f).segment<3>(3)));
  }
  const RootChart chart(rotations);
  ceres::Solver::Summary summary;
  for (auto _ : state) {
    Eigen::MatrixXd s = batch.synthetic.start;
    s.middleRows<3>(3) = chart.Coordinates(rotations);
    ceres::Problem naive;
    std::vector<double*> blocks;
    auto* smoothness =
        new ceres::DynamicAutoDiffCostFunction<NaiveSmoothness>(new NaiveSmoothness(problem));
    for (int f = 0; f < kFrames; ++f) {
      blocks.push_back(s.col(f).data());
      smoothness->AddParameterBlock(num_dofs);
      naive.AddResidualBlock(
          new ceres::AutoDiffCostFunction<NaiveFrameCost, ceres::DYNAMIC, 33>(
              new NaiveFrameCost(batch.synthetic, chart, f), problem.frames[f].num_residuals()),
          nullptr, blocks.back());
      for (int n = 6; n < num_dofs; ++n) {
        naive.SetParameterLowerBound(blocks.back(), n, problem.skeleton.hinges[n - 6].min_rad);
        naive.SetParameterUpperBound(blocks.back(), n, problem.skeleton.hinges[n - 6].max_rad);
      }
    }
    smoothness->SetNumResiduals(num_dofs * kFrames);
    naive.AddResidualBlock(smoothness, nullptr, blocks);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 100;
    options.function_tolerance = kTolerance;
    ceres::Solve(options, &naive, &summary);
  }
  CheckCost(batch, 2 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1, &state);
}
[[maybe_unused]] const bool kNaiveRegistered = [] {
  if (std::getenv("MPC_BENCHMARK_NAIVE") == nullptr) return false;
  benchmark::RegisterBenchmark("SolveBatch_BaselineNaive/paper", SolveBatch_BaselineNaive,
                               Terms::kPaper)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("SolveBatch_BaselineNaive/ours", SolveBatch_BaselineNaive,
                               Terms::kOurs)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

// Residuals of one frame with normal equations, and the same by automatic differentiation.
void EvaluateFrame(benchmark::State& state) {
  const Batch batch(Terms::kOurs);
  const BatchProblem& problem = batch.synthetic.problem;
  PosePoint point;
  point.pose = batch.synthetic.start.col(0);
  point.root_rotation = ExpSO3(point.pose.segment<3>(3));
  FrameScratch scratch;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
  for (auto _ : state) {
    point.Update(problem.skeleton, /*with_jacobian=*/true);
    benchmark::DoNotOptimize(
        EvaluateFrame(problem.frames[0], point, &scratch, &hessian, &gradient));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(EvaluateFrame)->Unit(benchmark::kMicrosecond);

void EvaluateFrame_BaselineAutoDiff(benchmark::State& state) {
  const Batch batch(Terms::kOurs);
  const SyntheticBatch& synthetic = batch.synthetic;
  Eigen::MatrixXd hessian;
  for (auto _ : state) {
    const Eigen::MatrixXd jacobian =
        testing::TwinJacobian(synthetic.problem.skeleton, synthetic.camera,
                              synthetic.ingredients[0], synthetic.start.col(0));
    hessian.noalias() = jacobian.transpose() * jacobian;
    benchmark::DoNotOptimize(hessian.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(EvaluateFrame_BaselineAutoDiff)->Unit(benchmark::kMicrosecond);

// A clip of ordinary quality.
testing::SyntheticClip NoisyClip(double fps) {
  return testing::MakeClip(MotionKind::kWalk, 3 * kFrames, fps,
                           DetectionNoise::White(5, 60, 0.1, 0.2), 1);
}

void ReportPerFrame(int num_frames, benchmark::State* state) {
  state->counters["s_per_frame"] = benchmark::Counter(
      num_frames, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void InitializeFrames(benchmark::State& state) {
  const testing::SyntheticClip clip = NoisyClip(kFps);
  const PoseOptions options = testing::PlainOptions();
  const ClipEvidence evidence(clip.skeleton, clip.camera, clip.detections.detections2d,
                              &clip.detections.detections3d, kFps, options);
  for (auto _ : state) benchmark::DoNotOptimize(InitializeFrames(evidence));
  ReportPerFrame(clip.num_frames(), &state);
}
BENCHMARK(InitializeFrames)->Unit(benchmark::kMillisecond);

// The whole pose stage of a clip on one core, with and without calibration, per frame rate: the
// number of basis vectors depends on it.
void EstimatePoses(benchmark::State& state, bool fit_proportions) {
  const testing::SyntheticClip clip = NoisyClip(static_cast<double>(state.range(0)));
  PoseOptions options = testing::PlainOptions();
  options.fit_proportions = fit_proportions;
  for (auto _ : state) benchmark::DoNotOptimize(testing::Estimate(clip, options));
  ReportPerFrame(clip.num_frames(), &state);
}
BENCHMARK_CAPTURE(EstimatePoses, fixed, false)
    ->ArgName("fps")
    ->Arg(30)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(EstimatePoses, fitted, true)
    ->ArgName("fps")
    ->Arg(5)
    ->Arg(30)
    ->Arg(60)
    ->Arg(120)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace mpc
