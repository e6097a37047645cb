#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "sim/core/error.h"
#include "sim/core/parallel.h"
#include "sim/solve/block_matrix.h"
#include "sim/solve/block_pattern_impl.h"
#include "sim/solve/cholmod_session.h"
#include "sim/solve/supernodal_cholesky.h"
#include "sim/solve/supernodal_solve.h"

namespace rhytid {

struct CholeskyFactor::Impl {
  explicit Impl(const BlockPattern& p);

  struct Release {
    cholmod_common* common;
    void operator()(cholmod_factor* factor) const { cholmod_free_factor(&factor, common); }
  };
  const BlockPattern* pattern;
  CholmodSession session;
  std::unique_ptr<cholmod_factor, Release> factor{nullptr, {&session}};
  std::optional<SupernodalCholesky> numbers;
  std::optional<SupernodalSolve> solver;
  bool usable = false;
  Precision precision = Precision::full;
  double smallest_pivot = 0, largest_pivot = 0, flops = 0;

  void measure_pivots();
  MatrixXd permuted(const MatrixXd& rhs) const;
  void permute_back(const Eigen::Ref<const MatrixXd>& x, MatrixXd& result) const;
  /// Columns in the factor's order, in place.
  void solve(MatrixXd& x) const;
  /// What the numbers may be worked on with.
  int threads() const;
};

CholeskyFactor::Impl::Impl(const BlockPattern& p) : pattern(&p) {
  const BlockPattern::Impl& impl = p.impl();
  // Already in fill-reducing postorder: with the natural order the values are read in place.
  session->nmethods = 1;
  session->method[0].ordering = CHOLMOD_NATURAL;
  session->postorder = 0;
  session->supernodal = CHOLMOD_SUPERNODAL;

  cholmod_sparse matrix =
      lower_pattern(static_cast<std::size_t>(p.num_unknowns()), static_cast<std::size_t>(p.num_entries()),
                    impl.scalar_column_start.data(), impl.scalar_rows.data());
  const SingleThreadScope single_thread;
  factor.reset(cholmod_analyze(&matrix, &session));
  if (!factor) throw_on_cholmod_error(*&session);
  flops = session->fl;
  cholmod_change_factor(CHOLMOD_REAL, /*to_ll=*/1, /*to_super=*/1, /*to_packed=*/1, /*to_monotonic=*/1,
                        factor.get(), &session);
  throw_on_cholmod_error(*&session);
  numbers.emplace(Supernodes(*factor));
  solver.emplace(Supernodes(*factor));
}

void CholeskyFactor::Impl::measure_pivots() {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  bool finite = true;
  const auto visit = [&](double d) {
    finite = finite && std::isfinite(d);
    low = std::min(low, d);
    high = std::max(high, d);
  };
  if (precision == Precision::full)
    numbers->for_diagonal<double>(visit);
  else
    numbers->for_diagonal<float>(visit);
  // LAPACK kernels let a NaN pivot through as if it were positive.
  usable = finite && low > 0;
  smallest_pivot = usable ? low * low : 0;
  largest_pivot = usable ? high * high : 0;
}

MatrixXd CholeskyFactor::Impl::permuted(const MatrixXd& rhs) const {
  const BlockPattern::Impl& p = pattern->impl();
  MatrixXd result(rhs.rows(), rhs.cols());
  for (Eigen::Index k = 0; k < rhs.cols(); ++k)
    for (int b = 0; b < p.num_blocks; ++b)
      result.col(k).segment<3>(3 * p.position[b]) = rhs.col(k).segment<3>(3 * b);
  return result;
}

void CholeskyFactor::Impl::permute_back(const Eigen::Ref<const MatrixXd>& x, MatrixXd& result) const {
  const BlockPattern::Impl& p = pattern->impl();
  result.resize(x.rows(), x.cols());
  for (Eigen::Index k = 0; k < x.cols(); ++k)
    for (int b = 0; b < p.num_blocks; ++b)
      result.col(k).segment<3>(3 * b) = x.col(k).segment<3>(3 * p.position[b]);
}

int CholeskyFactor::Impl::threads() const {
  return blas_is_reentrant() ? num_threads() : 1;
}

void CholeskyFactor::Impl::solve(MatrixXd& x) const {
  // Before the scope: an OpenBLAS over OpenMP makes its one thread the default of OpenMP.
  const int threads = this->threads();
  const SingleThreadBlas blas;
  const int columns = static_cast<int>(x.cols());
  if (precision == Precision::full) {
    solver->solve(x.data(), columns, threads);
    return;
  }
  // Scaled, since floats overflow at 1e38 and lose digits below 1e-38.
  Eigen::RowVectorXd scale = x.cwiseAbs().colwise().maxCoeff();
  for (double& s : scale) s = s > 0 ? s : 1;
  Eigen::MatrixXf single = (x * scale.cwiseInverse().asDiagonal()).cast<float>();
  solver->solve(single.data(), columns, threads);
  x = single.cast<double>() * scale.asDiagonal();
}

CholeskyFactor::CholeskyFactor(const BlockPattern& pattern) : impl_(std::make_unique<Impl>(pattern)) {}
CholeskyFactor::~CholeskyFactor() = default;
CholeskyFactor::CholeskyFactor(CholeskyFactor&&) noexcept = default;

bool CholeskyFactor::factorize(const BlockMatrix& matrix, double shift, Precision precision) {
  Impl& impl = *impl_;
  require(&matrix.pattern() == impl.pattern, "CholeskyFactor::factorize: the matrix has another pattern");
  impl.usable = false;
  impl.smallest_pivot = impl.largest_pivot = 0;
  const BlockPattern::Impl& p = impl.pattern->impl();
  const int threads = impl.threads();  // before the scope, as in solve
  const SingleThreadBlas blas;
  impl.precision = precision;
  const auto factorize_in = [&]<class Real>(Real) {
    return impl.numbers->factorize<Real>(p.scalar_column_start.data(), p.scalar_rows.data(),
                                         matrix.values().data(), shift, threads);
  };
  if (precision == Precision::full ? factorize_in(double()) : factorize_in(float())) impl.measure_pivots();
  return impl.usable;
}

Precision CholeskyFactor::precision() const {
  return impl_->precision;
}

bool CholeskyFactor::usable() const {
  return impl_->usable;
}

MatrixXd CholeskyFactor::solve(const MatrixXd& rhs) const {
  const Impl& impl = *impl_;
  const BlockPattern::Impl& p = impl.pattern->impl();
  require(impl.usable, "CholeskyFactor::solve: no usable factor");
  require(rhs.rows() == 3 * p.num_blocks, "CholeskyFactor::solve: wrong number of rows");
  if (rhs.cols() == 0) return rhs;
  MatrixXd permuted = impl.permuted(rhs), result;
  impl.solve(permuted);
  impl.permute_back(permuted, result);
  return result;
}

MatrixXd CholeskyFactor::solve(const BlockMatrix& matrix, const MatrixXd& rhs) const {
  MatrixXd x = solve(rhs), residual(rhs.rows(), rhs.cols());
  for (Eigen::Index k = 0; k < rhs.cols(); ++k) residual.col(k) = rhs.col(k) - matrix.multiply(x.col(k));
  return x + solve(residual);
}

std::optional<VectorXd> CholeskyFactor::solve_iteratively(const BlockMatrix& matrix, const VectorXd& rhs,
                                                          double tolerance, int max_iterations) const {
  const double wanted = tolerance * rhs.norm();
  if (wanted == 0) return VectorXd::Zero(rhs.size());
  VectorXd x = VectorXd::Zero(rhs.size()), r = rhs, direction;
  double old_rz = 0;
  for (int k = 0; k < max_iterations; ++k) {
    const VectorXd z = solve(r);
    const double rz = r.dot(z);
    direction = k == 0 ? z : VectorXd(z + rz / old_rz * direction);
    const VectorXd product = matrix.multiply(direction);
    const double curvature = direction.dot(product);
    if (!(rz > 0 && curvature > 0)) return std::nullopt;
    x += rz / curvature * direction;
    r -= rz / curvature * product;
    old_rz = rz;
    if (r.norm() > wanted) continue;
    // The recurrence drifts away from the residual where the matrix is ill-conditioned.
    if ((rhs - matrix.multiply(x)).norm() <= 2 * wanted) return x;
    return std::nullopt;
  }
  return std::nullopt;
}

double CholeskyFactor::smallest_pivot() const {
  return impl_->smallest_pivot;
}
double CholeskyFactor::largest_pivot() const {
  return impl_->largest_pivot;
}
std::size_t CholeskyFactor::factor_entries() const {
  return impl_->factor->xsize;
}
double CholeskyFactor::factor_flops() const {
  return impl_->flops;
}

}  // namespace rhytid
