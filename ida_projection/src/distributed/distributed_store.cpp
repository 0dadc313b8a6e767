// Tether: rows that are spread over processes, as VectorMover wants them.
// SPDX-License-Identifier: BSD-3-Clause
#include "distributed/distributed_store.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tether/linalg/index.hpp>

#include "host/rounding.hpp"
#include "movers/vector/vector_rows.hpp"

namespace tether::ida_projection {

namespace {

using linalg::at;

constexpr double kRankTolerance = 1e-6;
constexpr double kLocallySolved = 1e-12;
constexpr double kSolved = 1e-6;  // of the move; more is left to the next one
// Tight enough for a full row that depends on the others to leave nothing, however small the
// eigenvalues of H are.
constexpr double kSolvedForBorder = 1e-11;
constexpr int kMostSteps = 300, kPatience = 20;

// Outcomes by severity, so that the worst one is the largest.
constexpr Status kOutcomes[] = {Status::success, Status::callback_recoverable, Status::not_finite,
                                Status::callback_fatal};
constexpr int kCount = 4;

}  // namespace

DistributedStore::DistributedStore(const Constraints& constraints, Statistics& statistics,
                                   N_Vector like)
    : constraints_(constraints),
      given_(std::get<DistributedRows>(constraints.jacobian)),
      statistics_(statistics),
      n_(given_.unknowns),
      ghosts_(given_.ghosts),
      m_(constraints.count),
      border_(constraints, like),
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
      u_(like),
      unknowns_of_all_(static_cast<double>(N_VGetLength(like))) {
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

// The largest of one number >= 0 of each process, on all of them.
double DistributedStore::largest(double of_this_process) {
  if (n_ > 0) N_VGetArrayPointer(signal_)[0] = of_this_process;
  return N_VMaxNorm(signal_);
}

void DistributedStore::note(int flag, const char* what, const std::string& thrown) {
  if (flag == 0) return;
  const Status outcome = flag > 0 ? Status::callback_recoverable : Status::callback_fatal;
  if (own_outcome_ == Status::callback_fatal) return;
  own_outcome_ = outcome;
  own_text_ = std::string(what) +
              (thrown.empty() ? " returned " + std::to_string(flag) : " threw: " + thrown);
}

// The worst outcome of all processes, on all of them.
Status DistributedStore::agree() {
  const auto own = std::find(kOutcomes, kOutcomes + kCount, own_outcome_) - kOutcomes;
  const auto worst = static_cast<int>(largest(static_cast<double>(own)));
  // Only a process without unknowns cannot be heard by the others.
  const Status outcome = kOutcomes[std::max(worst, static_cast<int>(own))];
  if (outcome != Status::success)
    report.text = own_text_.empty() ? "rows of another process failed" : own_text_;
  if (outcome == Status::callback_fatal) report.fatal = true;
  own_outcome_ = Status::success;
  own_text_.clear();
  return outcome;
}

std::vector<double>& DistributedStore::load(N_Vector from, Numbers& to) {
  std::copy_n(N_VGetArrayPointer(from), n_, to.begin());
  if (!given_.update_ghosts) return to;
  std::string thrown;
  Vector copies = ghosts(to);
  note(guarded([&] { return given_.update_ghosts(own(std::as_const(to)), copies); }, thrown),
       "DistributedRows::update_ghosts", thrown);
  return to;
}

void DistributedStore::add_up(Numbers& from, N_Vector to) {
  double* entries = N_VGetArrayPointer(to);
  std::copy_n(from.begin(), n_, entries);
  if (!given_.add_ghosts) return;
  std::string thrown;
  const ConstVector copies(from.data() + n_, ghosts_);
  note(guarded([&] { return given_.add_ghosts(copies, Vector(entries, n_)); }, thrown),
       "DistributedRows::add_ghosts", thrown);
}

Status DistributedStore::value(double t, N_Vector y) {
  ++statistics_.value_evaluations;
  load(y, y_);
  std::string thrown;
  if (m_ > 0)
    note(guarded(
             [&] {
               return constraints_.value(t, ConstVector(y_.data(), n_ + ghosts_),
                                         Vector(room_.begin(m_, m_), m_));
             },
             thrown),
         "Constraints::value", thrown);
  if (m_ > 0 && !room_.end(g_.data(), m_))
    note(-1, "Constraints::value",
         "it writes past its end: Constraints::count is " + std::to_string(m_));
  double drift = 0.0;
  for (int i = 0; i < m_ && own_outcome_ == Status::success; ++i) {
    if (!std::isfinite(g_[at(i)])) {
      own_outcome_ = Status::not_finite;
      own_text_ = "g of " + constraints_.name(i) + " is not finite";
    }
    drift = std::max(drift, std::abs(g_[at(i)]));
  }
  const Status outcome = agree();
  if (outcome != Status::success) return outcome;
  drift_ = largest(drift);
  return border_.empty() ? outcome : of_border(border_.rows().value(t, y));
}

// The full rows report the same on every process.
Status DistributedStore::of_border(Status status) {
  if (status == Status::success) return status;
  report.text = border_.rows().report.text;
  report.fatal |= border_.rows().report.fatal;
  return status;
}

Status DistributedStore::fill(double t, N_Vector y) {
  ++statistics_.jacobian_evaluations;
  load(y, y_);
  std::fill(entries_.begin(), entries_.end(), 0.0);
  std::string thrown;
  if (m_ > 0)
    note(guarded(
             [&] {
               return given_.fill(t, ConstVector(y_.data(), n_ + ghosts_),
                                  Vector(entries_.data(), entries_.size()));
             },
             thrown),
         "DistributedRows::fill", thrown);
  const Status outcome = agree();
  if (outcome != Status::success || border_.empty()) return outcome;
  return of_border(border_.rows().fill(t, y));
}

bool DistributedStore::contains_algebraic(N_Vector id) {
  load(id, v_);
  bool found = false;
  for (std::size_t e = 0; e < entries_.size(); ++e)
    found |= entries_[e] != 0.0 && v_[at(given_.columns[e])] == 0.0;
  return largest(found ? 1.0 : 0.0) > 0.0 || border_.rows().contains_algebraic(id);
}

Status DistributedStore::factor(const VectorMetric& metric, N_Vector terms_at) {
  ++statistics_.factorizations;
  if (!coupling_known_) coupled_ = largest(ghosts_) > 0.0;
  coupling_known_ = true;
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
    if (!solver_.factor(kRankTolerance)) {
      own_outcome_ = Status::not_finite;
      own_text_ = "the entries of C are not finite";
    }
    whole = solver_.dropped() == 0;
  }
  const Status outcome = agree();
  if (outcome != Status::success) return outcome;
  whole_ = largest(whole ? 0.0 : 1.0) == 0.0;
  if (!border_.empty()) {
    if (terms_at != nullptr) border_.rows().sum_terms(terms_at);
    const Status bordered = of_border(border_.factor(metric, [&](N_Vector v, N_Vector move) {
      load(v, v_);
      for (int i = 0; i < m_; ++i) linear_[at(i)] = times(i, v_);
      solve_linear(metric.D(), move, kSolvedForBorder);
    }));
    if (bordered != Status::success) return bordered;
    whole_ = whole_ && border_.whole();
  }
  if (!whole_) ++statistics_.rank_drops;
  return Status::success;
}

double DistributedStore::times(int row, const Numbers& v) const {
  double sum = 0.0;
  for (int e = given_.starts[at(row)]; e < given_.starts[at(row + 1)]; ++e)
    sum += entries_[at(e)] * v[at(given_.columns[at(e)])];
  return sum;
}

// sum_p A_p^+ linear_p in the unknowns u = D^-1 dy. Where gradients follow, one step of each
// process does for A_p^+: H is symmetric to the last bit then, and consistent rows have the same
// solution.
void DistributedStore::shortest(N_Vector to) {
  if (m_ > 0 && coupled_)
    solver_.one_step(linear_.data(), dy_.data());
  else if (m_ > 0)
    solver_.solve(linear_.data(), dy_.data(), kLocallySolved);
  else
    std::fill(dy_.begin(), dy_.end(), 0.0);
  for (std::size_t j = 0; j < dy_.size(); ++j) dy_[j] = D_[j] > 0.0 ? dy_[j] / D_[j] : 0.0;
  add_up(dy_, to);
}

void DistributedStore::project(N_Vector v, N_Vector Hv) {
  load(v, v_);
  for (std::size_t j = 0; j < v_.size(); ++j) v_[j] *= D_[j];
  for (int i = 0; i < m_; ++i) linear_[at(i)] = times(i, v_);
  shortest(Hv);
}

void DistributedStore::solve(N_Vector D, N_Vector dy) {
  linear_ = g_;
  solve_linear(D, dy, kSolved);
  if (!border_.empty()) border_.add(D, dy);
}

// The shortest dy with C dy = linear_ over the rows that take part.
void DistributedStore::solve_linear(N_Vector D, N_Vector dy, double solved) {
  left_ = 0.0;
  if (!coupled_) {
    shortest(u_);
    N_VProd(u_, D, dy);
    return;
  }
  shortest(r_);
  N_VScale(1.0, r_, p_);
  N_VConst(0.0, u_);
  double size = N_VDotProd(r_, r_);
  const double first = size;
  double least = size;
  int since_least = 0;
  for (int k = 0; k < kMostSteps && size > solved * solved * first; ++k) {
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
  left_ = first > 0.0 ? std::sqrt(size / first) : 0.0;
  N_VProd(u_, D, dy);
}

bool DistributedStore::rounding_only() {
  const double unit = 64.0 * kEpsilon;
  bool more = false;
  for (int i = 0; i < m_; ++i) more |= !(std::abs(g_[at(i)]) <= unit * terms_[at(i)]);
  return largest(more ? 1.0 : 0.0) == 0.0 && border_.rows().rounding_only();
}

bool DistributedStore::contradict(N_Vector dy) {
  load(dy, v_);
  const double share = 0.5 * std::sqrt(unknowns_of_all_);
  std::vector<int> found;
  for (int i = 0; i < m_; ++i) {
    const double beyond = std::abs(g_[at(i)] - times(i, v_));
    if (!(beyond <= share * norm_[at(i)] + 1e2 * kEpsilon * (norm_[at(i)] + terms_[at(i)])))
      found.push_back(i);
  }
  const bool any = largest(found.empty() ? 0.0 : 1.0) > 0.0;
  if (!any && !border_.empty() && border_.contradict()) {
    report = border_.rows().report;
    return true;
  }
  if (!any) return false;
  if (found.empty())
    report.text = "rows of another process contradict each other";
  else
    report.contradicting(std::move(found), constraints_);
  return true;
}

std::unique_ptr<RowsAt> make_distributed_rows(const Constraints& constraints,
                                              const Options& options, Statistics& statistics,
                                              N_Vector like) {
  return std::make_unique<VectorRows<DistributedStore>>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
