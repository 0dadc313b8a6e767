// Tether: rows that are spread over processes (method, eq. 21). SPDX-License-Identifier:
// BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <tether/linalg/index.hpp>
#include <tether/linalg/sparse_minimum_norm.hpp>

#include "host/rounding.hpp"
#include "movers/vector/gradient_store.hpp"
#include "movers/vector/vector_rows.hpp"
#include "rows/row_trust.hpp"

namespace tether::ida_projection {

namespace {

using linalg::at;

// Tight enough for a full row that depends on the others to leave nothing, however small the
// eigenvalues of H are.
constexpr double kSolvedForBorder = 1e-11;
constexpr int kPatience = 20;

// Outcomes by severity, so that the worst one is the largest.
constexpr Status kOutcomes[] = {Status::success, Status::callback_recoverable, Status::not_finite,
                                Status::callback_fatal};

double norm(N_Vector v) { return std::sqrt(N_VDotProd(v, v)); }

// v <- v / D, 0 where D = 0. Of this process.
void divide(double* v, const double* D, long n) {
  for (long j = 0; j < n; ++j) v[j] = D[j] > 0.0 ? v[j] / D[j] : 0.0;
}

/// Full rows q joined to sparse rows C. Let w be the part of q that is orthogonal to the rows of C
/// in the metric: a move along w changes the values of q alone. The shortest move for C, followed
/// by moves along the w for what is left of the q, is the shortest move for all. A q that depends
/// on C has no w and must hold by itself.
class Border {
 public:
  /// move <- the shortest one with C move = C v.
  using Onto = std::function<void(N_Vector v, N_Vector move)>;

  /// `constraints`: the rows C, and what is joined to them.
  Border(const Constraints& constraints, N_Vector like, RowsReport& report)
      : set_(joined(constraints)),
        rows_(set_, uncounted_, like, report),
        depends_(rows_.g.size(), 0),
        wanted_(depends_.size(), 0.0),
        beyond_(wanted_),
        may_be_left_(wanted_),
        work_(like),
        unknowns_(std::get<DistributedRows>(constraints.jacobian).unknowns),
        report_(report) {
    for (std::size_t k = 0; k < depends_.size(); ++k) raw_.emplace_back(like);
  }

  bool empty() const { return raw_.empty(); }
  /// g and C of the full rows, their drift.
  GradientStore& rows() { return rows_; }
  const GradientStore& rows() const { return rows_; }
  /// After rows().fill(). `onto` is called as often on every process.
  Status factor(const VectorMetric& metric, const Onto& onto) {
    const double share = kContradicts * std::sqrt(static_cast<double>(N_VGetLength(work_)));
    const double* D = N_VGetArrayPointer(metric.D());
    for (std::size_t k = 0; k < raw_.size(); ++k) {
      N_Vector row = rows_.rows.gradients()[k];
      N_VScale(1.0, row, raw_[k]);
      N_VProd(row, metric.WT(), work_);
      may_be_left_[k] = share * norm(work_);
      N_VProd(row, metric.D(), work_);
      const double before = norm(work_);
      N_VProd(work_, metric.D(), work_);
      onto(work_, row);
      N_VLinearSum(1.0, work_, -1.0, row, row);
      divide(N_VGetArrayPointer(row), D, unknowns_);
      depends_[k] = !(norm(row) > RowTrust::kDependent * before) ? 1 : 0;
      if (depends_[k] != 0 && std::isfinite(before)) N_VConst(0.0, row);
      divide(N_VGetArrayPointer(row), D, unknowns_);
    }
    return rows_.factor(metric, nullptr);
  }
  /// dy, the shortest move for C, becomes that for all rows.
  void add(N_Vector D, N_Vector dy) {
    for (std::size_t k = 0; k < raw_.size(); ++k) {
      beyond_[k] = rows_.g[k] - N_VDotProd(raw_[k], dy);
      wanted_[k] = depends_[k] != 0 ? 0.0 : beyond_[k];
    }
    rows_.rows.solve(wanted_, D, work_);
    N_VLinearSum(1.0, dy, 1.0, work_, dy);
  }
  bool whole() const {
    return std::count(depends_.begin(), depends_.end(), 1) == 0 && rows_.whole();
  }
  /// After add().
  bool contradict() {
    for (std::size_t k = 0; k < raw_.size(); ++k) {
      if (depends_[k] == 0 || std::abs(beyond_[k]) <= may_be_left_[k]) continue;
      report_.text = set_.name(static_cast<int>(k)) + " contradicts the rows that it depends on";
      report_.rows.clear();
      return true;
    }
    return rows_.contradict(work_);
  }

 private:
  static Constraints joined(const Constraints& all) {
    Constraints set;
    set.jacobian = Gradients();
    set.joined = all.joined;
    return set;
  }

  Constraints set_;
  Statistics uncounted_;  // whoever asks for C counts
  GradientStore rows_;
  std::vector<OwnedVector> raw_;
  std::vector<char> depends_;  // on C
  std::vector<double> wanted_, beyond_, may_be_left_;
  OwnedVector work_;
  long unknowns_;  // of this process
  RowsReport& report_;
};

/// Rows that are DistributedRows, with Gradients joined to them, and their factors, for VectorRows.
///
/// With A = C D, A_p its rows on process p, u = D^-1 dy, the shortest u with A u = g solves
///
///     H u = sum_p A_p^+ g_p,     H = sum_p A_p^+ A_p
///
/// a sum of orthogonal projections (block Cimmino method: Elfving, Numer. Math. 35 (1980), 1;
/// accelerated: Arioli, Duff, Noailles, Ruiz, SIAM J. Sci. Stat. Comput. 13 (1992), 478), each of
/// which is a process's own solution of least norm, and so never explodes. Conjugate gradients
/// from u = 0 stay orthogonal to what the rows do not see, and grow towards the solution. H has
/// the eigenvalue 1 apart from what rows of several processes share: their number bounds the
/// number of steps. Without ghosts there is nothing to iterate.
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
        border_(constraints, like, report),
        place_(given_.columns.size()),
        entries_(given_.columns.size(), 0.0),
        y_(at(n_ + ghosts_), 0.0),
        D_(y_),
        v_(y_),
        dy_(y_),
        g_(at(m_), 0.0),
        linear_(g_),
        terms_(g_),
        norm_(g_),
        signal_(like),
        r_(like),
        p_(like),
        q_(like),
        u_(like) {
    N_VConst(0.0, signal_);
    std::iota(place_.begin(), place_.end(), 0);
    std::vector<int> columns(place_.size());
    for (int i = 0; i < m_; ++i)
      std::sort(place_.begin() + given_.starts[at(i)], place_.begin() + given_.starts[at(i + 1)],
                [this](int a, int b) { return given_.columns[at(a)] < given_.columns[at(b)]; });
    std::transform(place_.begin(), place_.end(), columns.begin(),
                   [this](int e) { return given_.columns[at(e)]; });
    if (m_ > 0) solver_.resize(n_ + ghosts_, given_.starts, std::move(columns), 0);
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
    double drift = 0.0;
    for (int i = 0; i < m_ && own_outcome_ == Status::success; ++i) {
      if (!std::isfinite(g_[at(i)])) {
        own_outcome_ = Status::not_finite;
        own_.text = "g of " + constraints_.name(i) + " is not finite";
      }
      drift = std::max(drift, std::abs(g_[at(i)]));
    }
    const Status outcome = agree();
    if (outcome != Status::success) return outcome;
    drift_ = largest(drift);
    return border_.empty() ? outcome : border_.rows().value(t, y);
  }
  Status fill(double t, N_Vector y) {
    ++statistics_.jacobian_evaluations;
    load(y, y_);
    std::fill(entries_.begin(), entries_.end(), 0.0);
    if (m_ > 0)
      call("DistributedRows::fill", [&] {
        return given_.fill(t, ConstVector(y_.data(), n_ + ghosts_),
                           Vector(entries_.data(), entries_.size()));
      });
    const Status outcome = agree();
    return outcome != Status::success || border_.empty() ? outcome : border_.rows().fill(t, y);
  }
  Status factor(const VectorMetric& metric, N_Vector terms_at) {
    ++statistics_.factorizations;
    coupled_ = largest(ghosts_) > 0.0;
    load(metric.WT(), v_);
    load(metric.D(), D_);
    for (int i = 0; i < m_; ++i) {
      double sum = 0.0, terms = 0.0;
      for (int e = given_.starts[at(i)]; e < given_.starts[at(i + 1)]; ++e) {
        const std::size_t j = at(given_.columns[at(e)]);
        sum += entries_[at(e)] * v_[j] * (entries_[at(e)] * v_[j]);
        terms += std::abs(entries_[at(e)] * y_[j]);
      }
      norm_[at(i)] = std::sqrt(sum);
      terms_[at(i)] = terms;
    }
    bool whole = true;
    if (m_ > 0) {
      double* to = solver_.entries();
      for (std::size_t e = 0; e < place_.size(); ++e) to[e] = entries_[at(place_[e])];
      std::copy(D_.begin(), D_.end(), solver_.metric());
      if (!solver_.factor()) {
        own_outcome_ = Status::not_finite;
        own_.text = "the entries of C are not finite";
      }
      whole = solver_.dropped() == 0;
    }
    const Status outcome = agree();
    if (outcome != Status::success) return outcome;
    whole_ = largest(whole ? 0.0 : 1.0) == 0.0;
    if (!border_.empty()) {
      if (terms_at != nullptr) border_.rows().sum_terms(terms_at);
      const Status bordered = border_.factor(metric, [&](N_Vector v, N_Vector move) {
        load(v, v_);
        for (int i = 0; i < m_; ++i) linear_[at(i)] = times(i, v_);
        solve_linear(metric.D(), move, kSolvedForBorder);
      });
      if (bordered != Status::success) return bordered;
      whole_ = whole_ && border_.whole();
    }
    if (!whole_) ++statistics_.rank_drops;
    return Status::success;
  }
  double solve(N_Vector D, N_Vector dy) {
    linear_ = g_;
    const double left = solve_linear(D, dy, linalg::SparseMinimumNorm::kSolved);
    if (!border_.empty()) border_.add(D, dy);
    return left;
  }
  double drift() const { return std::max(drift_, border_.rows().drift()); }
  /// After fill().
  bool contains_algebraic(N_Vector id) {
    load(id, v_);
    bool found = false;
    for (std::size_t e = 0; e < entries_.size(); ++e)
      found |= entries_[e] != 0.0 && v_[at(given_.columns[e])] == 0.0;
    return largest(found ? 1.0 : 0.0) > 0.0 || border_.rows().contains_algebraic(id);
  }
  bool whole() const { return whole_; }
  bool rounding_only() {
    bool more = false;
    for (int i = 0; i < m_; ++i) more |= !(std::abs(g_[at(i)]) <= kRoundingOfTerms * terms_[at(i)]);
    return largest(more ? 1.0 : 0.0) == 0.0 && border_.rows().rounding_only();
  }
  /// Whether rows ask for more than half a tolerance beyond dy.
  bool contradict(N_Vector dy) {
    load(dy, v_);
    const double share = kContradicts * std::sqrt(static_cast<double>(N_VGetLength(dy)));
    std::vector<int> found;
    for (int i = 0; i < m_; ++i) {
      const double beyond = std::abs(g_[at(i)] - times(i, v_));
      if (!(beyond <= share * norm_[at(i)] + 1e2 * kEpsilon * (norm_[at(i)] + terms_[at(i)])))
        found.push_back(i);
    }
    const bool any = largest(found.empty() ? 0.0 : 1.0) > 0.0;
    if (!any) return !border_.empty() && border_.contradict();
    report_.rows.clear();
    report_.text = "rows of another process contradict each other";
    if (!found.empty()) report_.contradicting(std::move(found), constraints_);
    return true;
  }

 private:
  using Numbers = std::vector<double>;  // of this process's unknowns, and of its ghosts behind them

  // Calls a function of the caller's; what goes wrong is told by agree().
  template <class Function>
  void call(const char* what, Function function) {
    std::string thrown;
    const int flag = guarded(function, thrown);
    if (flag != 0 && own_outcome_ != Status::callback_fatal)
      own_outcome_ = own_.failed(flag, what, thrown, m_);
  }
  void load(N_Vector from, Numbers& to) {
    std::copy_n(N_VGetArrayPointer(from), n_, to.begin());
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
  double times(int row, const Numbers& v) const {
    double sum = 0.0;
    for (int e = given_.starts[at(row)]; e < given_.starts[at(row + 1)]; ++e)
      sum += entries_[at(e)] * v[at(given_.columns[at(e)])];
    return sum;
  }
  void project(N_Vector v, N_Vector Hv) {
    load(v, v_);
    for (std::size_t j = 0; j < v_.size(); ++j) v_[j] *= D_[j];
    for (int i = 0; i < m_; ++i) linear_[at(i)] = times(i, v_);
    shortest(Hv);
  }
  // sum_p A_p^+ linear_p in the unknowns u = D^-1 dy. Where gradients follow, one step of each
  // process does for A_p^+: H is symmetric to the last bit then, and consistent rows have the same
  // solution.
  void shortest(N_Vector to) {
    if (m_ > 0 && coupled_)
      solver_.one_step(linear_.data(), dy_.data());
    else if (m_ > 0)
      solver_.solve(linear_.data(), dy_.data());
    else
      std::fill(dy_.begin(), dy_.end(), 0.0);
    divide(dy_.data(), D_.data(), static_cast<long>(dy_.size()));
    double* entries = N_VGetArrayPointer(to);
    std::copy_n(dy_.begin(), n_, entries);
    if (!given_.add_ghosts) return;
    const ConstVector copies(dy_.data() + n_, ghosts_);
    call("DistributedRows::add_ghosts",
         [&] { return given_.add_ghosts(copies, Vector(entries, n_)); });
  }
  // The shortest dy with C dy = linear_ over the rows that take part. Returns the part that is
  // left.
  double solve_linear(N_Vector D, N_Vector dy, double solved) {
    if (!coupled_) {
      shortest(u_);
      N_VProd(u_, D, dy);
      return 0.0;
    }
    shortest(r_);
    N_VScale(1.0, r_, p_);
    N_VConst(0.0, u_);
    double size = N_VDotProd(r_, r_);
    const double first = size;
    double least = size;
    int since_least = 0;
    for (int k = 0; k < 300 && size > solved * solved * first; ++k) {
      project(p_, q_);
      const double curvature = N_VDotProd(p_, q_);
      if (!(curvature > 0.0)) break;
      N_VLinearSum(1.0, u_, size / curvature, p_, u_);
      N_VLinearSum(1.0, r_, -size / curvature, q_, r_);
      const double next = N_VDotProd(r_, r_);
      N_VLinearSum(1.0, r_, next / size, p_, p_);
      size = next;
      since_least = size < least ? 0 : since_least + 1;
      least = std::min(least, size);
      if (!std::isfinite(size) || since_least > kPatience) break;
    }
    N_VProd(u_, D, dy);
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
  Border border_;
  std::vector<int> place_;  // of each entry of the solver: the caller's, whose order is free
  Numbers entries_, y_, D_, v_, dy_;
  Numbers g_, linear_;  // g, and C v
  GuardedRoom room_;
  Numbers terms_, norm_;                // sum_j |C_ij y_j|, |row_i(C WT)|
  OwnedVector signal_, r_, p_, q_, u_;  // signal_: 0 but for the first entry of each process
  double drift_ = 0.0;
  bool whole_ = false, coupled_ = false;  // coupled_: some process has ghosts
};

}  // namespace

std::unique_ptr<RowsAt> make_distributed_rows(const Constraints& constraints,
                                              const Options& options, Statistics& statistics,
                                              N_Vector like) {
  return std::make_unique<VectorRows<DistributedStore>>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
