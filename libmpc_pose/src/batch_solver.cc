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
// Schur complements up to this size are factorised: at 33 dofs those of up to 9 basis vectors.
constexpr int kMaxDirectSize = 300;
// Conjugate gradients end at this residual, relative; all their iterates lower the model's cost.
constexpr double kCoefficientTolerance = 1e-2;
constexpr int kMaxCoefficientIterations = 500;
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
    // Row n is S_n (I - D^T diag(1 - band_penalty_n) D).
    const Eigen::MatrixXd kept = 1 - problem_.band_penalty.array();
    penalized_ = s - (s * problem_.basis.transpose()).cwiseProduct(kept) * problem_.basis;
    return cost + problem_.smoothness.dot(s.cwiseProduct(penalized_).rowwise().sum());
  }

  // Normal equations of frame f in chart coordinates, E_d's own diagonal not included; the gradient
  // includes E_d. Needs a preceding Evaluate.
  void Linearize(int f, FrameScratch* scratch, Eigen::MatrixXd* hessian,
                 Eigen::VectorXd* gradient) {
    PosePoint& point = points_[f];
    point.UpdateJacobian(problem_.skeleton);
    EvaluateFrame(problem_.frames[f], point, scratch, hessian, gradient);
    const Eigen::Matrix3d chart = chart_.Jacobian(s.block<3, 1>(3, f));
    hessian->middleCols<3>(3) = (hessian->middleCols<3>(3) * chart).eval();
    hessian->middleRows<3>(3) = (chart.transpose() * hessian->middleRows<3>(3)).eval();
    gradient->segment<3>(3) = (chart.transpose() * gradient->segment<3>(3)).eval();
    *gradient += problem_.smoothness.cwiseProduct(penalized_.col(f));
  }

  // Derivatives of frame f's residuals, which `scratch` holds with their Jacobian from Linearize, by
  // the parameters, and J^T times them in chart coordinates.
  void LinearizeParameters(int f, const std::vector<SteppedProblem>& stepped, double step,
                           const FrameScratch& scratch, Eigen::MatrixXd* derivative,
                           Eigen::MatrixXd* cross) const {
    const Eigen::Index num_parameters = static_cast<Eigen::Index>(stepped.size());
    derivative->resize(scratch.residuals.size(), num_parameters);
    PosePoint point = points_[f];
    FrameScratch moved;
    for (Eigen::Index p = 0; p < num_parameters; ++p) {
      point.Update(stepped[p].skeleton, /*with_jacobian=*/false);
      EvaluateFrame(stepped[p].frames[f], point, &moved);
      derivative->col(p) = (moved.residuals - scratch.residuals) / step;
    }
    cross->noalias() = scratch.jacobian.transpose() * *derivative;
    cross->middleRows<3>(3) =
        (chart_.Jacobian(s.block<3, 1>(3, f)).transpose() * cross->middleRows<3>(3)).eval();
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

// y -= factor * x. A plain loop: the vectors are so short that Eigen's preparations would cost more.
void Subtract(Eigen::Index size, double factor, const double* __restrict x, double* __restrict y) {
  for (Eigen::Index i = 0; i < size; ++i) y[i] -= factor * x[i];
}

// Replaces a symmetric positive definite matrix by its inverse (the sweep operator, on the lower
// half); false when it is not positive definite. The last dofs go first: limbs do not touch one
// another, so that most columns are not touched by their pivots.
bool InvertInPlace(Eigen::MatrixXd* matrix, Eigen::VectorXd* scratch) {
  const Eigen::Index size = matrix->rows();
  Eigen::VectorXd& pivot_column = *scratch;
  pivot_column.resize(size);
  for (Eigen::Index k = size - 1; k >= 0; --k) {
    pivot_column.head(k) = matrix->row(k).head(k);
    pivot_column.tail(size - k) = matrix->col(k).tail(size - k);
    const double pivot = pivot_column[k];
    if (!(pivot > 0)) return false;
    for (Eigen::Index j = 0; j < size; ++j) {
      if (pivot_column[j] == 0) continue;
      Subtract(size - j, pivot_column[j] / pivot, &pivot_column[j], &(*matrix)(j, j));
    }
    pivot_column /= pivot;
    matrix->row(k).head(k) = pivot_column.head(k);
    matrix->col(k).tail(size - k) = pivot_column.tail(size - k);
    (*matrix)(k, k) = -1 / pivot;
  }
  matrix->triangularView<Eigen::Lower>() = -*matrix;
  matrix->triangularView<Eigen::StrictlyUpper>() = matrix->transpose();
  return true;
}

// The Gauss-Newton system of one linearisation and its damped solution: the frames are eliminated,
// which leaves the Schur complement in C. A small one is factorised. A large one is never formed but
// solved by conjugate gradients: its product with a vector is one small matrix product per frame,
// and because the frames of a batch resemble each other their mean is a good preconditioner.
class ArrowSystem {
 public:
  explicit ArrowSystem(const BatchProblem& problem)
      : basis_(problem.basis),
        weights_(problem.smoothness),
        band_(problem.band_penalty.array() / (1 - problem.band_penalty.array())),
        num_dofs_(problem.skeleton.num_dofs()),
        num_frames_(static_cast<int>(problem.frames.size())),
        num_basis_(static_cast<int>(problem.basis.rows())),
        hessians(problem.frames.size(), Eigen::MatrixXd(num_dofs_, num_dofs_)),
        gradients(num_dofs_, num_frames_),
        pinned(num_dofs_, num_frames_),
        pinned_step(num_dofs_, num_frames_),
        inverses_(problem.frames.size(), Eigen::MatrixXd(num_dofs_, num_dofs_)),
        stiffness_(num_dofs_ * num_dofs_, num_frames_),
        preconditioner_(SolvesDirectly() ? 0 : num_basis_, Eigen::MatrixXd(num_dofs_, num_dofs_)),
        eliminated_(num_dofs_, num_frames_),
        stiff_frames_(num_dofs_, num_frames_) {
    if (!SolvesDirectly()) return;
    products_.resize(num_frames_, num_basis_ * (num_basis_ + 1) / 2);
    int column = 0;
    for (int l = 0; l < num_basis_; ++l) {
      for (int k = l; k < num_basis_; ++k) {
        products_.col(column++) = basis_.row(k).cwiseProduct(basis_.row(l));
      }
    }
  }

  // Eliminates all frames for a damping and the dofs pinned now; false when the system is not
  // positive definite. The coefficients start from zero.
  bool Prepare(double damping) {
    coefficients_.setZero(num_dofs_, num_basis_);
    for (int f = 0; f < num_frames_; ++f) {
      if (!Eliminate(f, damping)) return false;
    }
    return true;
  }

  // Eliminates one frame, again when its pinned dofs have changed: B_f^-1, E_f = W - W B_f^-1 W (the
  // form that stays accurate for stiff W) and s_f = -B_f^-1 g_f.
  bool Eliminate(int f, double damping) {
    Eigen::MatrixXd& inverse = inverses_[f];
    inverse = hessians[f];
    // Damping on the data's own scale: E_d's stiffness does not resist moves inside the subspace.
    // The floor keeps dofs that no residual sees solvable.
    inverse.diagonal() *= 1 + damping;
    inverse.diagonal() += (1 + 1e-8) * weights_;
    inverse.diagonal().array() += 1e-9 * hessians[f].diagonal().maxCoeff();
    descent_ = -gradients.col(f);
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) descent_ -= inverse.col(n) * pinned_step(n, f);
    }
    for (int n = 0; n < num_dofs_; ++n) {
      if (!pinned(n, f)) continue;
      inverse.row(n).setZero();
      inverse.col(n).setZero();
      inverse(n, n) = 1;
    }
    if (!InvertInPlace(&inverse, &scratch_)) return false;
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) inverse(n, n) = 0;
    }
    auto stiffness = Stiffness(f);
    stiffness = -(weights_.asDiagonal() * inverse * weights_.asDiagonal());
    stiffness.diagonal() += weights_;
    eliminated_.col(f).noalias() = inverse * descent_;
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) eliminated_(n, f) = pinned_step(n, f);
    }
    return true;
  }

  // The frames' own steps for other gradients (N x F) of the system prepared.
  void Restart(const Eigen::MatrixXd& gradients_of_frames) {
    coefficients_.setZero();
    for (int f = 0; f < num_frames_; ++f) {
      eliminated_.col(f).noalias() = -inverses_[f] * gradients_of_frames.col(f);
    }
  }

  // Step of S (N x F); false when the system is not positive definite.
  bool Solve(Eigen::MatrixXd* step) {
    const Eigen::MatrixXd rhs = weights_.asDiagonal() * (eliminated_ * basis_.transpose());
    if (!(SolvesDirectly() ? Factorize(rhs) : Iterate(rhs))) return false;
    const Eigen::MatrixXd pull = weights_.asDiagonal() * (coefficients_ * basis_);
    *step = eliminated_;
    for (int f = 0; f < num_frames_; ++f) step->col(f).noalias() += inverses_[f] * pull.col(f);
    return step->allFinite();
  }

 private:
  bool SolvesDirectly() const { return num_dofs_ * num_basis_ <= kMaxDirectSize; }

  Eigen::Map<Eigen::MatrixXd> Stiffness(int f) {
    return {stiffness_.col(f).data(), num_dofs_, num_dofs_};
  }

  // Cholesky factorisation. All blocks (k, l) of the Schur complement come from one matrix product.
  bool Factorize(const Eigen::MatrixXd& rhs) {
    const Eigen::MatrixXd blocks = stiffness_ * products_;
    Eigen::MatrixXd schur(rhs.size(), rhs.size());
    const Eigen::Index size = num_dofs_;
    int column = 0;
    for (int l = 0; l < num_basis_; ++l) {
      for (int k = l; k < num_basis_; ++k) {
        schur.block(k * size, l * size, size, size) = blocks.col(column++).reshaped(size, size);
      }
      schur.diagonal().segment(l * size, size) += band_.col(l).cwiseProduct(weights_);
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(schur);
    if (llt.info() != Eigen::Success) return false;
    coefficients_ = rhs;
    Eigen::Map<Eigen::VectorXd> solution(coefficients_.data(), coefficients_.size());
    llt.solveInPlace(solution);
    return true;
  }

  // The Schur complement times C (N x K): sum_f E_f C d_f d_f^T + W (beta * C), * per entry.
  void Multiply(const Eigen::MatrixXd& c, Eigen::MatrixXd* product) {
    frames_.noalias() = c * basis_;
    for (int f = 0; f < num_frames_; ++f) {
      stiff_frames_.col(f).noalias() = Stiffness(f) * frames_.col(f);
    }
    product->noalias() = stiff_frames_ * basis_.transpose();
    *product += weights_.asDiagonal() * c.cwiseProduct(band_);
  }

  void Precondition(const Eigen::MatrixXd& residual, Eigen::MatrixXd* result) const {
    for (int k = 0; k < num_basis_; ++k) {
      result->col(k).noalias() = preconditioner_[k] * residual.col(k);
    }
  }

  // Conjugate gradients, from the coefficients so far.
  bool Iterate(const Eigen::MatrixXd& rhs) {
    const Eigen::VectorXd mean = stiffness_.rowwise().mean();
    for (int k = 0; k < num_basis_; ++k) {
      preconditioner_[k] = mean.reshaped(num_dofs_, num_dofs_);
      preconditioner_[k].diagonal() += band_.col(k).cwiseProduct(weights_);
      if (!InvertInPlace(&preconditioner_[k], &scratch_)) return false;
    }
    Eigen::MatrixXd z(num_dofs_, num_basis_);
    Eigen::MatrixXd product;
    Precondition(rhs, &z);
    const double goal = kCoefficientTolerance * kCoefficientTolerance * rhs.cwiseProduct(z).sum();
    Multiply(coefficients_, &product);
    Eigen::MatrixXd residual = rhs - product;
    Precondition(residual, &z);
    Eigen::MatrixXd direction = z;
    double rz = residual.cwiseProduct(z).sum();
    for (int i = 0; i < kMaxCoefficientIterations && rz > goal; ++i) {
      Multiply(direction, &product);
      const double curvature = direction.cwiseProduct(product).sum();
      if (!(curvature > 0)) return false;
      const double length = rz / curvature;
      coefficients_ += length * direction;
      residual -= length * product;
      Precondition(residual, &z);
      const double next = residual.cwiseProduct(z).sum();
      direction = z + next / rz * direction;
      rz = next;
    }
    return true;
  }

  const Eigen::MatrixXd& basis_;
  const Eigen::VectorXd& weights_;
  Eigen::MatrixXd band_;  // N x K: stiffness of the coefficients themselves
  int num_dofs_;
  int num_frames_;
  int num_basis_;

 public:
  std::vector<Eigen::MatrixXd> hessians;                      // F of N x N: the data terms
  Eigen::MatrixXd gradients;                                  // N x F
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> pinned;  // N x F: ends at a bound
  Eigen::MatrixXd pinned_step;                                // N x F: the way to that bound

 private:
  std::vector<Eigen::MatrixXd> inverses_;        // F: B_f^-1
  Eigen::MatrixXd stiffness_;                    // N^2 x F: E_f
  Eigen::MatrixXd products_;                     // F x K(K+1)/2: d_k d_l, k >= l
  std::vector<Eigen::MatrixXd> preconditioner_;  // K: of C's columns
  Eigen::MatrixXd eliminated_;                   // N x F: s_f
  Eigen::MatrixXd coefficients_;                 // N x K: dC
  Eigen::VectorXd descent_;
  Eigen::VectorXd scratch_;
  Eigen::MatrixXd frames_;        // N x F: C D
  Eigen::MatrixXd stiff_frames_;  // N x F: E_f (C D)_f
};

// Dofs of a frame that lie at a bound and are pulled beyond it.
Eigen::Array<bool, Eigen::Dynamic, 1> AtBounds(const Eigen::VectorXd& lower,
                                               const Eigen::VectorXd& upper,
                                               const Eigen::VectorXd& s,
                                               const Eigen::VectorXd& gradient) {
  return (s.array() <= lower.array() && gradient.array() > 0) ||
         (s.array() >= upper.array() && gradient.array() < 0);
}

// The damped step with the dofs that would leave their bounds ending there instead, and the others
// solved again around them: clipping alone would break the trajectory out of the subspace.
bool SolveWithinBounds(const Eigen::MatrixXd& s, const Eigen::VectorXd& lower,
                       const Eigen::VectorXd& upper, double damping, ArrowSystem* system,
                       Eigen::MatrixXd* step) {
  if (!system->Prepare(damping)) return false;
  for (int round = 0;; ++round) {
    if (!system->Solve(step)) return false;
    if (round == kMaxBoundRounds) return true;
    bool changed = false;
    for (int f = 0; f < s.cols(); ++f) {
      bool met = false;
      for (int n = 6; n < s.rows(); ++n) {
        const double end = s(n, f) + (*step)(n, f);
        if (system->pinned(n, f) ||
            (end >= lower[n] - kBoundSlack && end <= upper[n] + kBoundSlack)) {
          continue;
        }
        system->pinned(n, f) = met = true;
        system->pinned_step(n, f) = (end < lower[n] ? lower[n] : upper[n]) - s(n, f);
      }
      if (met && !system->Eliminate(f, damping)) return false;
      changed = changed || met;
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

Eigen::MatrixXd SubspaceCoefficients(const BatchProblem& problem, const Eigen::MatrixXd& poses) {
  const std::vector<Eigen::Matrix3d> rotations = RootRotations(poses);
  Eigen::MatrixXd s = poses;
  s.middleRows<3>(3) = RootChart(rotations).Coordinates(rotations);
  return s * problem.basis.transpose();
}

ReducedSystem ReduceBatch(const BatchProblem& problem, const Eigen::MatrixXd& poses,
                          const std::vector<SteppedProblem>& stepped, double step) {
  const int num_frames = static_cast<int>(problem.frames.size());
  const int num_parameters = static_cast<int>(stepped.size());
  const std::vector<Eigen::Matrix3d> rotations = RootRotations(poses);
  const RootChart chart(rotations);
  BatchState current(problem, chart);
  current.s = poses;
  current.s.middleRows<3>(3) = chart.Coordinates(rotations);
  const Eigen::VectorXd lower = problem.skeleton.LowerBounds();
  const Eigen::VectorXd upper = problem.skeleton.UpperBounds();
  FrameScratch scratch;
  ReducedSystem nothing = {Eigen::MatrixXd::Zero(num_parameters, num_parameters),
                           Eigen::VectorXd::Zero(num_parameters)};
  if (!std::isfinite(current.Evaluate(&scratch))) return nothing;

  ReducedSystem reduced = nothing;
  ArrowSystem system(problem);
  std::vector<Eigen::MatrixXd> cross(num_parameters, Eigen::MatrixXd(poses.rows(), num_frames));
  Eigen::VectorXd gradient;
  Eigen::MatrixXd derivative;
  Eigen::MatrixXd cross_of_frame;
  for (int f = 0; f < num_frames; ++f) {
    current.Linearize(f, &scratch, &system.hessians[f], &gradient);
    system.gradients.col(f) = gradient;
    system.pinned.col(f) = AtBounds(lower, upper, current.s.col(f), gradient);
    current.LinearizeParameters(f, stepped, step, scratch, &derivative, &cross_of_frame);
    for (int p = 0; p < num_parameters; ++p) cross[p].col(f) = cross_of_frame.col(p);
    reduced.hessian += derivative.transpose() * derivative;
    reduced.gradient += derivative.transpose() * scratch.residuals;
  }
  system.pinned_step.setZero();
  // The poses' answers T_p to a step of each parameter take X_q^T T_p off the Hessian.
  if (!system.Prepare(/*damping=*/0)) return nothing;
  Eigen::MatrixXd answer;
  for (int p = 0; p < num_parameters; ++p) {
    system.Restart(cross[p]);
    if (!system.Solve(&answer)) return nothing;
    for (int q = 0; q < num_parameters; ++q) {
      reduced.hessian(q, p) += cross[q].cwiseProduct(answer).sum();
    }
    reduced.gradient[p] += answer.cwiseProduct(system.gradients).sum();
  }
  reduced.hessian = (0.5 * (reduced.hessian + reduced.hessian.transpose())).eval();
  return reduced;
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
        system.pinned.col(f) = AtBounds(lower, upper, current.s.col(f), gradient);
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
