// Tether: rows that are spread over processes (method, eq. 21). SPDX-License-Identifier:
// BSD-3-Clause
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <tether/linalg/sparse_minimum_norm.hpp>

#include "host/rounding.hpp"
#include "movers/vector/gradient_store.hpp"
#include "movers/vector/vector_rows.hpp"

namespace tether::ida_projection {

namespace {

// Outcomes by severity, so that the worst one is the largest.
constexpr Status kOutcomes[] = {Status::success, Status::callback_recoverable, Status::not_finite,
                                Status::callback_fatal};

// The Gradients that are joined to a set.
Constraints joined_to(const Constraints& all) {
  Constraints set;
  set.jacobian = Gradients();
  set.joined = all.joined;
  return set;
}

/// Rows that are DistributedRows, with Gradients joined to them, and their factors, for VectorRows.
///
/// With A = C D, A_p its rows on process p, u = D^-1 dy, the shortest u with A u = g solves
///
///     H u = sum_p A_p^+ g_p,     H = sum_p A_p^+ A_p
///
/// where the full rows, known to all, count as those of one more process. H is a sum of orthogonal
/// projections (block Cimmino method: Elfving, Numer. Math. 35 (1980), 1; accelerated: Arioli,
/// Duff, Noailles, Ruiz, SIAM J. Sci. Stat. Comput. 13 (1992), 478), each of which is a solution of
/// least norm, and so never explodes. Conjugate gradients from u = 0 stay orthogonal to what the
/// rows do not see, and grow towards the solution. H has the eigenvalue 1 apart from what rows of
/// several processes share: their number bounds the number of steps. A process alone has nothing to
/// iterate.
///
/// Inner products are those of the N_Vector, so no message is sent from here but by the caller's
/// two functions of the ghosts. What decides is known to all processes, see largest().
class DistributedStore {
 public:
  DistributedStore(const Constraints& constraints, Statistics& statistics, N_Vector like,
                   RowsReport& report)
      : constraints_(constraints),
        given_(std::get<DistributedRows>(constraints.jacobian)),
        statistics_(statistics),
        report_(report),
        n_(given_.unknowns),
        ghosts_(given_.ghosts),
        m_(constraints.count),
        joined_(joined_to(constraints)),
        full_(joined_, uncounted_, like, report),
        C_(m_, n_ + ghosts_),
        entries_(given_.columns.size()),
        y_(n_ + ghosts_),
        D_(y_),
        v_(y_),
        dy_(Eigen::VectorXd::Zero(y_.size())),
        g_(Eigen::VectorXd::Zero(m_)),
        ones_(like),
        signal_(like),
        r_(like),
        p_(like),
        q_(like),
        u_(like) {
    N_VConst(0.0, signal_);
    N_VConst(1.0, ones_);
    for (std::size_t k = 0; k < full_.g.size(); ++k) rows_.emplace_back(like);
    may_be_left_.resize(rows_.size());
    std::vector<Eigen::Triplet<double>> numbers;
    for (int i = 0; i < m_; ++i)
      for (int e = given_.starts[index(i)]; e < given_.starts[index(i + 1)]; ++e)
        numbers.emplace_back(i, given_.columns[index(e)], e);
    C_.setFromTriplets(numbers.begin(), numbers.end());
    place_.assign(C_.valuePtr(), C_.valuePtr() + C_.nonZeros());
    const int* columns = C_.innerIndexPtr();
    if (m_ > 0) solver_.resize(n_ + ghosts_, given_.starts, {columns, columns + C_.nonZeros()}, 0);
  }

  Status value(double t, N_Vector y) {
    ++statistics_.value_evaluations;
    load(y, y_);
    if (m_ > 0)
      call("Constraints::value", [&] {
        return room_.written(g_.data(), m_, m_, [&](double* to) {
          return constraints_.value(t, ConstVector(y_.data(), n_ + ghosts_), Vector(to, m_));
        });
      });
    for (int i = 0; i < m_ && own_outcome_ == Status::success; ++i)
      if (!std::isfinite(g_[i])) {
        own_outcome_ = Status::not_finite;
        own_.text = "g of " + constraints_.name(i) + " is not finite";
      }
    const Status outcome = agree();
    if (outcome != Status::success) return outcome;
    drift_ = largest(g_.lpNorm<Eigen::Infinity>());
    return rows_.empty() ? outcome : full_.value(t, y);
  }
  Status fill(double t, N_Vector y) {
    ++statistics_.jacobian_evaluations;
    load(y, y_);
    entries_.setZero();
    if (m_ > 0)
      call("DistributedRows::fill", [&] {
        return given_.fill(t, ConstVector(y_.data(), n_ + ghosts_),
                           Vector(entries_.data(), entries_.size()));
      });
    for (std::size_t e = 0; e < place_.size(); ++e) C_.valuePtr()[e] = entries_[place_[e]];
    const Status outcome = agree();
    return outcome != Status::success || rows_.empty() ? outcome : full_.fill(t, y);
  }
  Status factor(const VectorMetric& metric, N_Vector terms_at) {
    ++statistics_.factorizations;
    coupled_ = largest(ghosts_) > 0.0 || !rows_.empty();
    load(metric.WT(), v_);
    load(metric.D(), D_);
    norm_ = (C_.cwiseAbs2() * v_.cwiseAbs2()).cwiseSqrt();
    terms_ = C_.cwiseAbs() * y_.cwiseAbs();
    bool whole = true;
    if (m_ > 0) {
      std::copy_n(C_.valuePtr(), C_.nonZeros(), solver_.entries());
      std::copy_n(D_.data(), D_.size(), solver_.metric());
      if (!solver_.factor()) {
        own_outcome_ = Status::not_finite;
        own_.text = "the entries of C are not finite";
      }
      whole = solver_.dropped() == 0;
    }
    const Status outcome = agree();
    if (outcome != Status::success) return outcome;
    whole_ = largest(whole ? 0.0 : 1.0) == 0.0;
    if (terms_at != nullptr) full_.sum_terms(terms_at);
    const double share = kContradicts * std::sqrt(static_cast<double>(N_VGetLength(u_)));
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      N_VScale(1.0, full_.rows.gradients()[k], rows_[k]);
      N_VProd(rows_[k], metric.WT(), u_);
      may_be_left_[k] = share * std::sqrt(N_VDotProd(u_, u_));
    }
    const Status full = full_.factor(metric.D(), metric.WT());
    if (full != Status::success) return full;
    whole_ = whole_ && full_.whole();
    if (!whole_) ++statistics_.rank_drops;
    return Status::success;
  }
  double solve(N_Vector D, N_Vector dy) {
    linear_ = g_;
    shortest(coupled_ ? r_ : u_);
    const double left = coupled_ ? iterate(dy) : 0.0;
    N_VProd(u_, D, dy);
    return left;
  }
  double drift() const { return std::max(drift_, full_.drift()); }
  /// After fill().
  bool contains_algebraic(N_Vector id) {
    load(id, v_);
    linear_ = C_.cwiseAbs() * (1.0 - v_.array()).matrix();
    return largest(linear_.lpNorm<Eigen::Infinity>()) > 0.0 || full_.contains_algebraic(id);
  }
  bool whole() const { return whole_; }
  bool rounding_only() {
    const bool only = (g_.array().abs() <= kRoundingOfTerms * terms_.array()).all();
    return largest(only ? 0.0 : 1.0) == 0.0 && full_.rounding_only();
  }
  /// Whether rows ask for more than half a tolerance beyond dy.
  bool contradict(N_Vector dy) {
    report_.rows.clear();
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      if (std::abs(full_.g[k] - N_VDotProd(rows_[k], dy)) <= may_be_left_[k]) continue;
      report_.text = joined_.name(static_cast<int>(k)) + " contradicts the rows that it depends on";
      return true;
    }
    load(dy, v_);
    const double share = kContradicts * std::sqrt(static_cast<double>(N_VGetLength(dy)));
    std::vector<int> found;
    linear_ = (g_ - C_ * v_).cwiseAbs();
    for (int i = 0; i < m_; ++i)
      if (!(linear_[i] <= share * norm_[i] + 1e2 * kEpsilon * (norm_[i] + terms_[i])))
        found.push_back(i);
    if (largest(found.empty() ? 0.0 : 1.0) == 0.0) return false;
    report_.text = "rows of another process contradict each other";
    if (!found.empty()) report_.contradicting(std::move(found), constraints_);
    return true;
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  // Calls a function of the caller's; what goes wrong is told by agree().
  template <class Function>
  void call(const char* what, Function function) {
    std::string thrown;
    const int flag = guarded(function, thrown);
    if (flag != 0 && own_outcome_ != Status::callback_fatal)
      own_outcome_ = own_.failed(flag, what, thrown, m_);
  }
  void load(N_Vector from, Eigen::VectorXd& to) {
    std::copy_n(N_VGetArrayPointer(from), n_, to.data());
    if (!given_.update_ghosts) return;
    Vector copies(to.data() + n_, ghosts_);
    call("DistributedRows::update_ghosts",
         [&] { return given_.update_ghosts(ConstVector(to.data(), n_), copies); });
  }
  // The largest of one number >= 0 of each process, on all of them.
  double largest(double of_this_process) {
    if (n_ > 0) N_VGetArrayPointer(signal_)[0] = of_this_process;
    return N_VMaxNorm(signal_);
  }
  // The worst outcome of all processes, on all of them.
  Status agree() {
    const auto own =
        std::find(std::begin(kOutcomes), std::end(kOutcomes), own_outcome_) - kOutcomes;
    const auto worst = static_cast<int>(largest(static_cast<double>(own)));
    // Only a process without unknowns cannot be heard by the others.
    const Status outcome = kOutcomes[std::max(worst, static_cast<int>(own))];
    if (outcome != Status::success)
      report_.text = own_.text.empty() ? "rows of another process failed" : own_.text;
    report_.fatal |= outcome == Status::callback_fatal;
    own_outcome_ = Status::success;
    own_ = RowsReport();
    return outcome;
  }
  void project(N_Vector v, N_Vector Hv) {
    load(v, v_);
    v_.array() *= D_.array();
    linear_.noalias() = C_ * v_;
    shortest(Hv);
    full_.rows.add_part(v, Hv);
  }
  // sum_p A_p^+ linear_p in the unknowns u = D^-1 dy. Where gradients follow, one step of each
  // process does for A_p^+: H is symmetric to the last bit then, and consistent rows have the same
  // solution.
  void shortest(N_Vector to) {
    if (m_ > 0 && coupled_)
      solver_.one_step(linear_.data(), dy_.data());
    else if (m_ > 0)
      solver_.solve(linear_.data(), dy_.data());
    dy_ = (D_.array() > 0.0).select(dy_.array() / D_.array(), 0.0);
    double* entries = N_VGetArrayPointer(to);
    std::copy_n(dy_.data(), n_, entries);
    if (!given_.add_ghosts) return;
    const ConstVector copies(dy_.data() + n_, ghosts_);
    call("DistributedRows::add_ghosts",
         [&] { return given_.add_ghosts(copies, Vector(entries, n_)); });
  }
  // u_ <- H^-1 (r_ + what the full rows ask for). Returns the part that is left.
  double iterate(N_Vector spare) {
    full_.rows.solve(full_.g, ones_, spare);
    N_VLinearSum(1.0, r_, 1.0, spare, r_);
    N_VScale(1.0, r_, p_);
    N_VConst(0.0, u_);
    double size = N_VDotProd(r_, r_);
    const double first = size;
    constexpr double kSolved = linalg::SparseMinimumNorm::kSolved;
    for (int k = 0; k < 300 && size > kSolved * kSolved * first; ++k) {
      project(p_, q_);
      const double curvature = N_VDotProd(p_, q_);
      if (!(curvature > 0.0)) break;
      N_VLinearSum(1.0, u_, size / curvature, p_, u_);
      N_VLinearSum(1.0, r_, -size / curvature, q_, r_);
      const double next = N_VDotProd(r_, r_);
      N_VLinearSum(1.0, r_, next / size, p_, p_);
      size = next;
    }
    return first > 0.0 ? std::sqrt(size / first) : 0.0;
  }

  const Constraints& constraints_;
  const DistributedRows& given_;
  Statistics& statistics_;
  RowsReport& report_;
  RowsReport own_;  // of this process
  Status own_outcome_ = Status::success;
  int n_, ghosts_, m_;
  linalg::SparseMinimumNorm solver_;
  Constraints joined_;
  Statistics uncounted_;                            // of full rows: whoever asks for C counts
  GradientStore full_;                              // the joined ones
  std::vector<OwnedVector> rows_;                   // their gradients
  std::vector<double> may_be_left_;                 // of each of them, without a contradiction
  Eigen::SparseMatrix<double, Eigen::RowMajor> C_;  // of this process, ghosts last
  std::vector<int> place_;          // of each entry of C_: the caller's, whose order is free
  Eigen::VectorXd entries_;         // as the caller orders them
  Eigen::VectorXd y_, D_, v_, dy_;  // of this process's unknowns, and of its ghosts behind them
  Eigen::VectorXd g_, linear_;      // g, and C v
  Eigen::VectorXd terms_, norm_;    // sum_j |C_ij y_j|, |row_i(C WT)|
  GuardedRoom room_;
  OwnedVector ones_, signal_, r_, p_, q_, u_;  // signal_: 0 but for the first entry of each process
  double drift_ = 0.0;
  bool whole_ = false, coupled_ = false;  // coupled_: there are ghosts or full rows
};

}  // namespace

std::unique_ptr<RowsAt> make_distributed_rows(const Constraints& constraints,
                                              const Options& options, Statistics& statistics,
                                              N_Vector like) {
  return std::make_unique<VectorRows<DistributedStore>>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
