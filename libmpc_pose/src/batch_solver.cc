#include "mpc/pose/batch_solver.h"

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <limits>

#include "mpc/core/rigid.h"
#include "mpc/pose/root_chart.h"

namespace mpc {
namespace {

constexpr int kMaxBoundRounds = 2;     // times a step is solved again around the bounds it meets
constexpr double kBoundSlack = 0.005;  // rad; less is clipped
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Eigen::Matrix3d> RootRotations(const Eigen::MatrixXd& poses) {
  std::vector<Eigen::Matrix3d> rotations(poses.cols());
  for (int f = 0; f < poses.cols(); ++f) rotations[f] = ExpSO3(poses.block<3, 1>(3, f));
  return rotations;
}

// A batch in chart coordinates: S is N x F with rows 3..5 the root chart's numbers.
class BatchState {
 public:
  BatchState(const BatchProblem& problem, const RootChart& chart)
      : problem_(problem), chart_(chart), points_(problem.frames.size()) {}

  Eigen::MatrixXd s;

  // Kinematics and data cost of every frame, plus E_d.
  double Evaluate(FrameScratch* scratch) {
    double cost = 0;
    for (size_t f = 0; f < points_.size(); ++f) {
      PosePoint& point = points_[f];
      point.pose = s.col(f);
      point.root_rotation = chart_.Rotation(s.block<3, 1>(3, f));
      point.Update(problem_.skeleton, /*with_jacobian=*/false);
      cost += EvaluateFrame(problem_.frames[f], point, scratch);
      if (!std::isfinite(cost)) return kInfinity;
    }
    // S M with M = I - D^T diag(1 - band_penalty) D.
    const Eigen::VectorXd kept = 1 - problem_.band_penalty.array();
    penalized_ = s - (s * problem_.basis.transpose()) * kept.asDiagonal() * problem_.basis;
    return cost + problem_.smoothness.dot(s.cwiseProduct(penalized_).rowwise().sum());
  }

  // Normal equations of frame f in chart coordinates, E_d's own diagonal not included; the gradient
  // includes E_d. Needs a preceding Evaluate.
  void Linearize(int f, FrameScratch* scratch, Eigen::MatrixXd* hessian,
                 Eigen::VectorXd* gradient) {
    PosePoint& point = points_[f];
    JointJacobian(problem_.skeleton, point.state, &point.joint_jacobian);
    EvaluateFrame(problem_.frames[f], point, scratch, hessian, gradient);
    const Eigen::Matrix3d chart = chart_.Jacobian(s.block<3, 1>(3, f));
    hessian->middleCols<3>(3) = (hessian->middleCols<3>(3) * chart).eval();
    hessian->middleRows<3>(3) = (chart.transpose() * hessian->middleRows<3>(3)).eval();
    gradient->segment<3>(3) = (chart.transpose() * gradient->segment<3>(3)).eval();
    *gradient += problem_.smoothness.cwiseProduct(penalized_.col(f));
  }

  void Swap(BatchState* other) {
    s.swap(other->s);
    points_.swap(other->points_);
    penalized_.swap(other->penalized_);
  }

  Eigen::MatrixXd Poses() const {
    Eigen::MatrixXd poses = s;
    for (int f = 0; f < poses.cols(); ++f) {
      poses.block<3, 1>(3, f) = LogSO3(chart_.Rotation(s.block<3, 1>(3, f)));
    }
    return poses;
  }

 private:
  const BatchProblem& problem_;
  const RootChart& chart_;
  std::vector<PosePoint> points_;
  Eigen::MatrixXd penalized_;  // S M, N x F: the gradient of E_d without its weight
};

// The Gauss-Newton system of one linearisation and its damped solution by the Schur complement in C.
class ArrowSystem {
 public:
  ArrowSystem(const BatchProblem& problem)
      : basis_(problem.basis),
        weights_(problem.smoothness),
        band_(problem.band_penalty.array() / (1 - problem.band_penalty.array())),
        num_dofs_(problem.skeleton.num_dofs()),
        num_frames_(static_cast<int>(problem.frames.size())),
        num_basis_(static_cast<int>(problem.basis.rows())),
        hessians(problem.frames.size(), Eigen::MatrixXd(num_dofs_, num_dofs_)),
        gradients(num_dofs_, num_frames_),
        pinned(num_dofs_, num_frames_),
        pinned_step(Eigen::MatrixXd::Zero(num_dofs_, num_frames_)),
        inverses_(problem.frames.size(), Eigen::MatrixXd(num_dofs_, num_dofs_)),
        packed_(num_frames_, num_dofs_ * (num_dofs_ + 1) / 2) {
    // Products d_k d_l per frame, packed over k >= l: the Schur complement is one matrix product.
    products_.resize(num_basis_ * (num_basis_ + 1) / 2, num_frames_);
    int row = 0;
    for (int k = 0; k < num_basis_; ++k) {
      for (int l = 0; l <= k; ++l) {
        products_.row(row++) = basis_.row(k).cwiseProduct(basis_.row(l));
      }
    }
  }

  // Step of S (N x F) for the current linearisation; false when the system is not positive definite.
  bool Solve(double damping, Eigen::MatrixXd* step) {
    const int n2 = num_dofs_ * num_basis_;
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(num_basis_, num_dofs_);
    step->resize(num_dofs_, num_frames_);
    for (int f = 0; f < num_frames_; ++f) {
      Eigen::MatrixXd block = hessians[f];
      // Damping on the data's own scale: E_d's stiffness does not resist moves inside the subspace.
      // The floor keeps dofs that no residual sees solvable.
      block.diagonal() *= 1 + damping;
      block.diagonal() += (1 + 1e-8) * weights_;
      block.diagonal().array() += 1e-9 * hessians[f].diagonal().maxCoeff();
      Eigen::VectorXd descent = -gradients.col(f);
      for (int n = 0; n < num_dofs_; ++n) {
        if (pinned(n, f)) descent -= block.col(n) * pinned_step(n, f);
      }
      for (int n = 0; n < num_dofs_; ++n) {
        if (!pinned(n, f)) continue;
        block.row(n).setZero();
        block.col(n).setZero();
        block(n, n) = 1;
      }
      const Eigen::LLT<Eigen::MatrixXd> llt(block);
      if (llt.info() != Eigen::Success) return false;
      Eigen::MatrixXd& inverse = inverses_[f];
      inverse.setIdentity();
      llt.solveInPlace(inverse);
      for (int n = 0; n < num_dofs_; ++n) {
        if (pinned(n, f)) inverse(n, n) = 0;
      }
      // E_f = W - W B_f^-1 W, the form that stays accurate for stiff W.
      int column = 0;
      for (int m = 0; m < num_dofs_; ++m) {
        for (int n = 0; n <= m; ++n) {
          packed_(f, column++) =
              (m == n ? weights_[n] : 0.0) - weights_[m] * inverse(m, n) * weights_[n];
        }
      }
      step->col(f).noalias() = inverse * descent;
      for (int n = 0; n < num_dofs_; ++n) {
        if (pinned(n, f)) (*step)(n, f) = pinned_step(n, f);
      }
      rhs.noalias() += basis_.col(f) * (weights_.cwiseProduct(step->col(f))).transpose();
    }
    const Eigen::MatrixXd blocks = products_ * packed_;
    Eigen::MatrixXd schur(n2, n2);
    int column = 0;
    for (int m = 0; m < num_dofs_; ++m) {
      for (int n = 0; n <= m; ++n, ++column) {
        int row = 0;
        for (int k = 0; k < num_basis_; ++k) {
          for (int l = 0; l <= k; ++l, ++row) {
            const double value = blocks(row, column);
            schur(m * num_basis_ + k, n * num_basis_ + l) = value;
            schur(m * num_basis_ + l, n * num_basis_ + k) = value;
          }
        }
      }
    }
    for (int n = 0; n < num_dofs_; ++n) {
      schur.diagonal().segment(n * num_basis_, num_basis_) += weights_[n] * band_;
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(schur);
    if (llt.info() != Eigen::Success) return false;
    Eigen::Map<Eigen::VectorXd> coefficients(rhs.data(), n2);
    llt.solveInPlace(coefficients);
    for (int f = 0; f < num_frames_; ++f) {
      const Eigen::VectorXd pull = weights_.cwiseProduct(rhs.transpose() * basis_.col(f));
      step->col(f).noalias() += inverses_[f] * pull;
    }
    return step->allFinite();
  }

 private:
  const Eigen::MatrixXd& basis_;
  const Eigen::VectorXd& weights_;
  Eigen::VectorXd band_;  // K: stiffness of the coefficients themselves
  int num_dofs_;
  int num_frames_;
  int num_basis_;

 public:
  std::vector<Eigen::MatrixXd> hessians;                      // F of N x N: the data terms
  Eigen::MatrixXd gradients;                                  // N x F
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> pinned;  // N x F: ends at a bound
  Eigen::MatrixXd pinned_step;                                // N x F: the way to that bound

 private:
  std::vector<Eigen::MatrixXd> inverses_;
  Eigen::MatrixXd packed_;    // F x N(N+1)/2
  Eigen::MatrixXd products_;  // K(K+1)/2 x F
};

// The damped step with the dofs that would leave their bounds ending there instead, and the others
// solved again around them: clipping alone would break the trajectory out of the subspace.
bool SolveWithinBounds(const Eigen::MatrixXd& s, const Eigen::VectorXd& lower,
                       const Eigen::VectorXd& upper, double damping, ArrowSystem* system,
                       Eigen::MatrixXd* step) {
  for (int round = 0;; ++round) {
    if (!system->Solve(damping, step)) return false;
    if (round == kMaxBoundRounds) return true;
    bool changed = false;
    for (int f = 0; f < s.cols(); ++f) {
      for (int n = 6; n < s.rows(); ++n) {
        const double end = s(n, f) + (*step)(n, f);
        if (system->pinned(n, f) ||
            (end >= lower[n] - kBoundSlack && end <= upper[n] + kBoundSlack)) {
          continue;
        }
        system->pinned(n, f) = changed = true;
        system->pinned_step(n, f) = (end < lower[n] ? lower[n] : upper[n]) - s(n, f);
      }
    }
    if (!changed) return true;
  }
}

}  // namespace

double BatchCost(const BatchProblem& problem, const Eigen::MatrixXd& poses) {
  const std::vector<Eigen::Matrix3d> rotations = RootRotations(poses);
  const RootChart chart(rotations);
  BatchState state(problem, chart);
  state.s = poses;
  state.s.middleRows<3>(3) = chart.Coordinates(rotations);
  FrameScratch scratch;
  return state.Evaluate(&scratch);
}

SolveSummary SolveBatch(const BatchProblem& problem, const BatchSolveOptions& options,
                        Eigen::MatrixXd* poses) {
  const auto start = std::chrono::steady_clock::now();
  const int num_frames = static_cast<int>(problem.frames.size());
  const Eigen::VectorXd lower = problem.skeleton.LowerBounds();
  const Eigen::VectorXd upper = problem.skeleton.UpperBounds();
  const auto clamp = [&](Eigen::MatrixXd* s) {
    for (int f = 0; f < num_frames; ++f) {
      s->col(f) = s->col(f).cwiseMax(lower).cwiseMin(upper).eval();
    }
  };

  const std::vector<Eigen::Matrix3d> rotations = RootRotations(*poses);
  const RootChart chart(rotations);
  BatchState current(problem, chart);
  BatchState trial(problem, chart);
  current.s = *poses;
  current.s.middleRows<3>(3) = chart.Coordinates(rotations);
  clamp(&current.s);

  SolveSummary summary;
  FrameScratch scratch;
  double cost = current.Evaluate(&scratch);
  summary.initial_cost = summary.final_cost = cost;
  const auto finish = [&](Termination termination) {
    *poses = current.Poses();
    summary.termination = termination;
    summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return summary;
  };
  if (!std::isfinite(cost)) return finish(Termination::kFailed);

  ArrowSystem system(problem);
  Eigen::VectorXd gradient;
  Eigen::MatrixXd step;
  double damping = options.initial_damping;
  bool linearized = false;
  while (summary.iterations < options.max_iterations) {
    if (!linearized) {
      for (int f = 0; f < num_frames; ++f) {
        current.Linearize(f, &scratch, &system.hessians[f], &gradient);
        system.gradients.col(f) = gradient;
        system.pinned.col(f) =
            (current.s.col(f).array() <= lower.array() && gradient.array() > 0) ||
            (current.s.col(f).array() >= upper.array() && gradient.array() < 0);
      }
      linearized = true;
    }
    ++summary.iterations;
    double trial_cost = kInfinity;
    const auto pinned = system.pinned;
    system.pinned_step.setZero();
    if (SolveWithinBounds(current.s, lower, upper, damping, &system, &step)) {
      trial.s = current.s + step;
      clamp(&trial.s);
      trial_cost = trial.Evaluate(&scratch);
    }
    system.pinned = pinned;
    if (trial_cost < cost) {
      const double decrease = (cost - trial_cost) / cost;
      current.Swap(&trial);
      cost = summary.final_cost = trial_cost;
      damping = std::max(damping / 5, 1e-9);
      linearized = false;
      if (decrease < options.relative_tolerance) return finish(Termination::kConverged);
    } else {
      damping *= 8;
      if (damping > 1e8) return finish(Termination::kNoStep);
    }
  }
  return finish(Termination::kMaxIterations);
}

}  // namespace mpc
