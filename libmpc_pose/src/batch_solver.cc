#include "mpc/pose/batch_solver.h"

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <limits>

#include "dense_kernel.h"
#include "mpc/core/rigid.h"
#include "mpc/pose/root_chart.h"

namespace mpc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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
        stride_(PaddedRows(num_dofs_)),
        hessians(problem.frames.size(), MatrixXd(num_dofs_, num_dofs_)),
        gradients(num_dofs_, num_frames_),
        pinned(num_dofs_, num_frames_),
        pinned_step(num_dofs_, num_frames_),
        inverses_(problem.frames.size(), MatrixXd::Zero(stride_, num_dofs_)),
        scratch_(stride_),
        eliminated_(num_dofs_, num_frames_) {
    if (!SolvesDirectly()) {
      transposed_basis_ = basis_.transpose();
      preconditioner_.resize(num_basis_, MatrixXd::Zero(stride_, num_dofs_));
      frame_.resize(stride_);
      stiff_frames_.setZero(stride_, num_frames_);
      return;
    }
    stiffness_.resize(static_cast<Eigen::Index>(num_dofs_) * num_dofs_, num_frames_);
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
    coefficients_.setZero(stride_, num_basis_);
    for (int f = 0; f < num_frames_; ++f) {
      if (!Eliminate(f, damping)) return false;
    }
    return SolvesDirectly() || PrepareIterations();
  }

  // Eliminates one frame, again when its pinned dofs have changed: B_f^-1 and s_f = -B_f^-1 g_f.
  bool Eliminate(int f, double damping) {
    MatrixXd& inverse = inverses_[f];
    inverse.topRows(num_dofs_) = hessians[f];
    // Damping on the data's own scale: E_d's stiffness does not resist moves inside the subspace.
    // The floor keeps dofs that no residual sees solvable.
    inverse.diagonal() *= 1 + damping;
    inverse.diagonal() += (1 + 1e-8) * weights_;
    inverse.diagonal().array() += 1e-9 * hessians[f].diagonal().maxCoeff();
    VectorXd descent = -gradients.col(f);
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) descent -= inverse.col(n).head(num_dofs_) * pinned_step(n, f);
    }
    for (int n = 0; n < num_dofs_; ++n) {
      if (!pinned(n, f)) continue;
      inverse.row(n).setZero();
      inverse.col(n).setZero();
      inverse(n, n) = 1;
    }
    if (!InvertInPlace(num_dofs_, stride_, inverse.data(), scratch_.data())) return false;
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) inverse(n, n) = 0;
    }
    eliminated_.col(f).noalias() = inverse.topRows(num_dofs_) * descent;
    for (int n = 0; n < num_dofs_; ++n) {
      if (pinned(n, f)) eliminated_(n, f) = pinned_step(n, f);
    }
    return true;
  }

  // The frames' own steps for other gradients (N x F) of the system prepared.
  void Restart(const MatrixXd& gradients_of_frames) {
    coefficients_.setZero();
    for (int f = 0; f < num_frames_; ++f) {
      eliminated_.col(f).noalias() = -inverses_[f].topRows(num_dofs_) * gradients_of_frames.col(f);
    }
  }

  // Step of S (N x F); false when the system is not positive definite.
  bool Solve(MatrixXd* step) {
    MatrixXd rhs = MatrixXd::Zero(stride_, num_basis_);
    rhs.topRows(num_dofs_) = weights_.asDiagonal() * (eliminated_ * basis_.transpose());
    if (!(SolvesDirectly() ? Factorize(rhs) : Iterate(rhs))) return false;
    const MatrixXd pull = weights_.asDiagonal() * (coefficients_.topRows(num_dofs_) * basis_);
    *step = eliminated_;
    for (int f = 0; f < num_frames_; ++f) {
      step->col(f).noalias() += inverses_[f].topRows(num_dofs_) * pull.col(f);
    }
    return step->allFinite();
  }

 private:
  bool SolvesDirectly() const { return num_dofs_ * num_basis_ <= kMaxDirectSize; }

  // E_f = W - W B_f^-1 W, for the mean of B_f^-1 that of the E_f: the form that stays accurate for
  // stiff W.
  MatrixXd Stiffness(const MatrixXd& inverse) const {
    MatrixXd stiffness =
        -(weights_.asDiagonal() * inverse.topRows(num_dofs_) * weights_.asDiagonal());
    stiffness.diagonal() += weights_;
    return stiffness;
  }

  // Cholesky factorisation. All blocks (k, l) of the Schur complement come from one matrix product.
  bool Factorize(const MatrixXd& rhs) {
    const Eigen::Index size = num_dofs_;
    for (int f = 0; f < num_frames_; ++f) stiffness_.col(f) = Stiffness(inverses_[f]).reshaped();
    const MatrixXd blocks = stiffness_ * products_;
    MatrixXd schur(size * num_basis_, size * num_basis_);
    int column = 0;
    for (int l = 0; l < num_basis_; ++l) {
      for (int k = l; k < num_basis_; ++k) {
        schur.block(k * size, l * size, size, size) = blocks.col(column++).reshaped(size, size);
      }
      schur.diagonal().segment(l * size, size) += band_.col(l).cwiseProduct(weights_);
    }
    const Eigen::LLT<Eigen::Ref<MatrixXd>> llt(schur);
    if (llt.info() != Eigen::Success) return false;
    VectorXd solution = rhs.topRows(size).reshaped();
    llt.solveInPlace(solution);
    coefficients_.topRows(size) = solution.reshaped(size, num_basis_);
    return true;
  }

  // The preconditioner is that of the first dofs pinned: it need not be exact.
  bool PrepareIterations() {
    MatrixXd mean = MatrixXd::Zero(stride_, num_dofs_);
    for (const MatrixXd& inverse : inverses_) mean += inverse / num_frames_;
    const MatrixXd stiffness = Stiffness(mean);
    for (int k = 0; k < num_basis_; ++k) {
      preconditioner_[k].topRows(num_dofs_) = stiffness;
      preconditioner_[k].diagonal() += band_.col(k).cwiseProduct(weights_);
      if (!InvertInPlace(num_dofs_, stride_, preconditioner_[k].data(), scratch_.data())) {
        return false;
      }
    }
    return true;
  }

  // The Schur complement times C: sum_f E_f C d_f d_f^T + W (beta * C), * per entry.
  void Multiply(const MatrixXd& c, MatrixXd* product) {
    for (int f = 0; f < num_frames_; ++f) {
      auto stiff = stiff_frames_.col(f);
      MultiplyColumns(stride_, num_basis_, c.data(), basis_.col(f).data(), frame_.data());
      scratch_.head(num_dofs_) = weights_.cwiseProduct(frame_.head(num_dofs_));
      MultiplyColumns(stride_, num_dofs_, inverses_[f].data(), scratch_.data(), stiff.data());
      stiff = frame_ - stiff;
    }
    for (int k = 0; k < num_basis_; ++k) {
      MultiplyColumns(stride_, num_frames_, stiff_frames_.data(), transposed_basis_.col(k).data(),
                      product->col(k).data());
    }
    product->topRows(num_dofs_) =
        weights_.asDiagonal() *
        (product->topRows(num_dofs_) + c.topRows(num_dofs_).cwiseProduct(band_)).eval();
  }

  void Precondition(const MatrixXd& residual, MatrixXd* result) const {
    for (int k = 0; k < num_basis_; ++k) {
      MultiplyColumns(stride_, num_dofs_, preconditioner_[k].data(), residual.col(k).data(),
                      result->col(k).data());
    }
  }

  // Conjugate gradients, from the coefficients so far.
  bool Iterate(const MatrixXd& rhs) {
    MatrixXd z = MatrixXd::Zero(stride_, num_basis_);
    MatrixXd product = z;
    Precondition(rhs, &z);
    const double goal = kCoefficientTolerance * kCoefficientTolerance * rhs.cwiseProduct(z).sum();
    Multiply(coefficients_, &product);
    MatrixXd residual = rhs - product;
    Precondition(residual, &z);
    MatrixXd direction = z;
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

  const MatrixXd& basis_;
  const VectorXd& weights_;
  MatrixXd band_;  // N x K: stiffness of the coefficients themselves
  int num_dofs_;
  int num_frames_;
  int num_basis_;
  int stride_;  // N with padding, of the rows of what the kernels see; the padding is zero

 public:
  std::vector<MatrixXd> hessians;                             // F of N x N: the data terms
  MatrixXd gradients;                                         // N x F
  Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic> pinned;  // N x F: ends at a bound
  MatrixXd pinned_step;                                       // N x F: the way to that bound

 private:
  std::vector<MatrixXd> inverses_;  // F of stride x N: B_f^-1
  VectorXd scratch_;                // stride
  MatrixXd eliminated_;             // N x F: s_f
  MatrixXd coefficients_;           // stride x K: dC
  // When it is factorised:
  MatrixXd stiffness_;  // N^2 x F: E_f
  MatrixXd products_;   // F x K(K+1)/2: d_k d_l, k >= l
  // When it is not:
  MatrixXd transposed_basis_;             // F x K
  std::vector<MatrixXd> preconditioner_;  // K of stride x N: of C's columns
  VectorXd frame_;                        // stride: C d_f
  MatrixXd stiff_frames_;                 // stride x F: W^-1 E_f C d_f
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
    reduced.data_cost += scratch.residuals.squaredNorm();
    reduced.num_residuals += static_cast<int>(scratch.residuals.size());
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
