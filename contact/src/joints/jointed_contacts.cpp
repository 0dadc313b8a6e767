// Tether: contacts of bodies that joints hold. SPDX-License-Identifier: BSD-3-Clause
#include "joints/jointed_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tether/contact/evaluate.hpp>
#include <tether/linalg/index.hpp>
#include <tether/linalg/symmetric_eigen.hpp>

#include "joints/held_start.hpp"

namespace tether::contact::detail {

namespace {

// A_nn over that without joints; both are squares of lengths, the one left by rounding 1e-14.
constexpr double kHeld = 1e-14;
constexpr Eigen::Index kFew = 20;  // contacts whose dense factors cost little beside their solve
constexpr double kSoft = 1e-5;     // compliance of a support over what moves there without joints
constexpr double kSlip = 1e-12;    // of the speeds that a slip is the difference of

using linalg::at;

using Vector6 = Eigen::Matrix<double, 6, 1>;

double normal_speed(const ContactRows& c, const std::vector<Vector6d>& v) {
  double w = c.bias[0] + c.J1.row(0).dot(v[at(c.first)]);
  if (c.second >= 0) w += c.J2.row(0).dot(v[at(c.second)]);
  return w;
}

// Upper bound of the sum of its terms, row by row.
Eigen::Vector3d largest_speeds(const ContactRows& c, const std::vector<Vector6d>& v) {
  Eigen::Vector3d w = c.bias.cwiseAbs() + c.J1.cwiseAbs() * v[at(c.first)].cwiseAbs();
  if (c.second >= 0) w += c.J2.cwiseAbs() * v[at(c.second)].cwiseAbs();
  return w;
}

}  // namespace

JointedContacts::JointedContacts(const Options& options) : solver_(options) {}

// Mechanisms first, then single bodies.
int JointedContacts::node_of(const Mechanisms& mechanisms, int body) const {
  const int m = mechanisms.mechanism_of(body);
  return m >= 0 ? m : mechanisms.count() + body;
}

void JointedContacts::find_islands(const Mechanisms& mechanisms,
                                   const std::vector<ContactRows>& contacts) {
  const int n = static_cast<int>(contacts.size());
  const int nodes = mechanisms.count() + mechanisms.bodies();
  sets_.reset(nodes);
  const auto moving = [&](int body) { return body >= 0 && mechanisms.moves(body); };
  const auto any = [&](const ContactRows& c) {
    return node_of(mechanisms, moving(c.first) ? c.first : c.second);
  };
  for (const ContactRows& c : contacts)
    if (moving(c.first) && moving(c.second))
      sets_.join(node_of(mechanisms, c.first), node_of(mechanisms, c.second));
  order_.resize(contacts.size());
  std::iota(order_.begin(), order_.end(), 0);
  first_of_.assign(at(nodes), n);
  for (int i = n - 1; i >= 0; --i) first_of_[at(sets_.root(any(contacts[at(i)])))] = i;
  const auto island = [&](int i) { return first_of_[at(sets_.root(any(contacts[at(i)])))]; };
  std::sort(order_.begin(), order_.end(), [&](int i, int j) {
    const int a = island(i), b = island(j);
    return a != b ? a < b : i < j;
  });
  island_start_.clear();
  for (int k = 0; k < n; ++k)
    if (k == 0 || island(order_[at(k)]) != island(order_[at(k - 1)])) island_start_.push_back(k);
  island_start_.push_back(n);
}

// By node, then by contact.
void JointedContacts::collect_sides(const Mechanisms& mechanisms,
                                    const std::vector<ContactRows>& contacts) {
  sides_.clear();
  for (std::size_t l = 0; l < members_.size(); ++l) {
    const ContactRows& c = contacts[at(members_[l])];
    const int body[2] = {c.first, c.second};
    for (int s = 0; s < 2; ++s) {
      if (body[s] < 0 || !mechanisms.moves(body[s])) continue;
      const Matrix36d H = (s == 0 ? c.J1 : c.J2) * mechanisms.root(body[s]);
      sides_.push_back({static_cast<int>(l), body[s], node_of(mechanisms, body[s]), H});
    }
  }
  std::stable_sort(sides_.begin(), sides_.end(),
                   [](const Side& a, const Side& b) { return a.node < b.node; });
}

// Lower blocks of A of the contacts that touch one mechanism, sides begin .. end: column by column
// what the mechanism answers.
void JointedContacts::add_mechanism(Mechanisms& mechanisms, std::size_t begin, std::size_t end) {
  Mechanism& mechanism = mechanisms[sides_[begin].node];
  for (std::size_t p = begin; p < end;) {
    const int j = sides_[p].contact;
    answer_.setZero(mechanism.entries(), 3);
    for (; p < end && sides_[p].contact == j; ++p)
      answer_.middleRows(6 * mechanisms.place_of(sides_[p].body), 6) += sides_[p].H.transpose();
    for (int k = 0; k < 3; ++k) mechanism.project(answer_.col(k).data());
    // Squares: never negative, and small where the joints hold a direction.
    A_.block<3, 3>(3 * j, 3 * j) += answer_.transpose() * answer_;
    for (std::size_t q = p; q < end; ++q)
      A_.block<3, 3>(3 * sides_[q].contact, 3 * j) +=
          sides_[q].H * answer_.middleRows(6 * mechanisms.place_of(sides_[q].body), 6);
  }
}

void JointedContacts::assemble(Mechanisms& mechanisms, const std::vector<Eigen::Vector3d>& own) {
  const Eigen::Index n = static_cast<Eigen::Index>(members_.size());
  A_.setZero(3 * n, 3 * n);
  alone_.setZero(n);
  for (const Side& s : sides_) alone_[s.contact] += s.H.row(0).squaredNorm();
  for (std::size_t begin = 0, end = 0; begin < sides_.size(); begin = end) {
    while (end < sides_.size() && sides_[end].node == sides_[begin].node) ++end;
    if (sides_[begin].node < mechanisms.count()) {
      add_mechanism(mechanisms, begin, end);
      continue;
    }
    for (std::size_t p = begin; p < end; ++p)
      for (std::size_t q = p; q < end; ++q)
        A_.block<3, 3>(3 * sides_[q].contact, 3 * sides_[p].contact) +=
            sides_[q].H * sides_[p].H.transpose();
  }
  A_.triangularView<Eigen::StrictlyUpper>() = A_.transpose();
  for (Eigen::Index i = 0; i < n && !own.empty(); ++i)
    A_.diagonal().segment<3>(3 * i) += own[at(members_[static_cast<std::size_t>(i)])];
  clear_held_slips();
  tie_normals();
}

// w_n = a (x_n - x_n of the other), a the mobility of that: a row that is not symmetric.
void JointedContacts::tie_normals() {
  tied_to_.assign(members_.size(), -1);
  for (std::size_t l = 0; l < members_.size(); ++l) {
    if (members_[l] < first_tied_) continue;
    const int of = normal_of_[at(members_[l] - first_tied_)];
    const auto place = std::lower_bound(members_.begin(), members_.end(), of) - members_.begin();
    tied_to_[l] = static_cast<int>(place);
    const auto row = 3 * static_cast<Eigen::Index>(l);
    const double a = A_(3 * place, 3 * place);
    A_(row, row) = a;
    A_(row, 3 * place) = -a;
  }
}

// Directions of slip that the joints hold: what rounding leaves of them in A would be divided by
// what it leaves of them on the diagonal.
void JointedContacts::clear_held_slips() {
  held_slips_.clear();
  slip_alone_.setZero(alone_.size());
  for (const Side& s : sides_) slip_alone_[s.contact] += s.H.bottomRows<2>().squaredNorm();
  for (Eigen::Index i = 0; i < alone_.size(); ++i) {
    const linalg::SymmetricEigen<2> eigen =
        linalg::symmetric_eigen(linalg::Matrix<2, 2>(A_.block<2, 2>(3 * i + 1, 3 * i + 1)));
    for (int k = 0; k < 2; ++k) {
      if (eigen.values[k] > kHeld * slip_alone_[i]) continue;
      const Eigen::Vector2d d = eigen.vectors.col(k);
      held_slips_.push_back({static_cast<int>(i), d});
      auto rows = A_.middleRows<2>(3 * i + 1);
      rows -= (d * (d.transpose() * rows)).eval();
      auto columns = A_.middleCols<2>(3 * i + 1);
      columns -= ((columns * d) * d.transpose()).eval();
    }
  }
}

// Leaves the contacts in kept_ whose normal velocity an impulse can change.
void JointedContacts::drop_held(const std::vector<ContactRows>& contacts,
                                const std::vector<Vector6d>& v) {
  kept_.clear();
  for (std::size_t l = 0; l < members_.size(); ++l) {
    const int i = static_cast<int>(l);
    if (tied_to_[l] >= 0) {
      if (std::binary_search(kept_.begin(), kept_.end(), tied_to_[l])) kept_.push_back(i);
      continue;
    }
    if (A_(3 * i, 3 * i) > kHeld * alone_[i]) {
      kept_.push_back(i);
      continue;
    }
    const ContactRows& c = contacts[at(members_[l])];
    const double w = normal_speed(c, v), scale = largest_speeds(c, v)[0];
    if (w >= -solver_.options().tolerance * scale) continue;
    result_.blocked.push_back(members_[l]);
    result_.status = Status::infeasible;
    result_.error = std::max(result_.error, -w / scale);
  }
}

// b of a contact; where joints hold a direction of slip, what rounding leaves there is no slip.
Eigen::Vector3d JointedContacts::approach(int place, const ContactRows& c,
                                          const std::vector<Vector6d>& v) const {
  Eigen::Vector3d w = c.bias + c.J1 * v[at(c.first)];
  if (c.second >= 0) w += c.J2 * v[at(c.second)];
  for (const HeldSlip& h : held_slips_) {
    if (h.place != place) continue;
    const double slip = h.direction.dot(w.tail<2>());
    if (std::abs(slip) <= kSlip * largest_speeds(c, v).tail<2>().sum())
      w.tail<2>() -= slip * h.direction;
  }
  return -w;
}

// From and to x of all contacts.
void JointedContacts::solve_kept(const std::vector<ContactRows>& contacts,
                                 const std::vector<Vector6d>& v, linalg::VectorX& x) {
  const auto n = static_cast<Eigen::Index>(kept_.size());
  if (n == 0) return;
  Eigen::VectorXd b(3 * n), mu(n), start(3 * n);
  if (kept_.size() < members_.size())
    for (Eigen::Index j = 0; j < n; ++j)  // in place: kept_ ascends
      for (Eigen::Index i = 0; i < n; ++i)
        A_.block<3, 3>(3 * i, 3 * j) = A_.block<3, 3>(3 * kept_[static_cast<std::size_t>(i)],
                                                      3 * kept_[static_cast<std::size_t>(j)])
                                           .eval();
  for (Eigen::Index i = 0; i < n; ++i) {
    const int contact = members_[at(kept_[static_cast<std::size_t>(i)])];
    const ContactRows& c = contacts[at(contact)];
    b.segment<3>(3 * i) = approach(kept_[static_cast<std::size_t>(i)], c, v);
    mu[i] = c.mu;
    start.segment<3>(3 * i) = x.segment<3>(3 * contact);
  }
  const auto A = A_.topLeftCorner(3 * n, 3 * n);
  const Problem problem = Problem::dense(A, b, mu);
  const double tolerance = solver_.options().tolerance;
  if (n <= kFew && !(evaluate(problem, solver_.options().law, start).fixed_point <= tolerance) &&
      share_loads(A) && !hold_all(A, b, mu, tolerance, start)) {
    // Contacts that slide share their loads as soft supports of one kind would.
    Eigen::MatrixXd soft = A;
    for (Eigen::Index i = 0; i < n; ++i) {
      const int place = kept_[static_cast<std::size_t>(i)];
      const double slip = slip_alone_[place] / 2;
      soft.diagonal().segment<3>(3 * i) += kSoft * Eigen::Vector3d(alone_[place], slip, slip);
    }
    const Solution shared = solver_.solve(Problem::dense(soft, b, mu), start);
    result_.counts.add(shared.counts);
    if (shared.status == Status::solved) start = shared.impulses;
  }
  const Solution solution = solver_.solve(problem, start);
  result_.counts.add(solution.counts);
  if (!(solution.error <= result_.error)) result_.error = solution.error;
  if (solution.status != Status::solved && result_.status != Status::infeasible)
    result_.status = solution.status;
  for (Eigen::Index i = 0; i < n; ++i)
    x.segment<3>(3 * members_[at(kept_[static_cast<std::size_t>(i)])]) =
        solution.impulses.segment<3>(3 * i);
}

void JointedContacts::apply(Mechanisms& mechanisms, const linalg::VectorX& x,
                            std::vector<Vector6d>& v) {
  for (std::size_t begin = 0, end = 0; begin < sides_.size(); begin = end) {
    while (end < sides_.size() && sides_[end].node == sides_[begin].node) ++end;
    const int node = sides_[begin].node;
    const auto impulse = [&](std::size_t p) {
      return Vector6(sides_[p].H.transpose() * x.segment<3>(3 * members_[at(sides_[p].contact)]));
    };
    if (node >= mechanisms.count()) {
      for (std::size_t p = begin; p < end; ++p)
        v[at(sides_[p].body)] += mechanisms.root(sides_[p].body) * impulse(p);
      continue;
    }
    Mechanism& mechanism = mechanisms[node];
    std::vector<double>& pull = mechanisms.pull(node);
    answer_.setZero(mechanism.entries(), 1);
    for (std::size_t p = begin; p < end; ++p)
      answer_.middleRows(6 * mechanisms.place_of(sides_[p].body), 6) += impulse(p);
    for (Eigen::Index k = 0; k < answer_.rows(); ++k)
      pull[static_cast<std::size_t>(k)] -= answer_(k, 0);
    mechanism.project(answer_.data());
    for (Eigen::Index k = 0; k < answer_.rows(); ++k)
      pull[static_cast<std::size_t>(k)] += answer_(k, 0);
    mechanisms.add(node, answer_.data(), v);
  }
}

const JointedContacts::Result& JointedContacts::solve(Mechanisms& mechanisms,
                                                      const std::vector<ContactRows>& contacts,
                                                      const std::vector<Eigen::Vector3d>& own,
                                                      std::vector<Vector6d>& v, linalg::VectorX& x,
                                                      const std::vector<int>& normal_of) {
  result_ = {};
  normal_of_ = normal_of;
  first_tied_ = static_cast<int>(contacts.size() - normal_of.size());
  if (contacts.empty()) return result_;
  find_islands(mechanisms, contacts);
  for (std::size_t k = 0; k + 1 < island_start_.size(); ++k) {
    members_.assign(order_.begin() + island_start_[k], order_.begin() + island_start_[k + 1]);
    collect_sides(mechanisms, contacts);
    assemble(mechanisms, own);
    drop_held(contacts, v);
    for (std::size_t l = 0, j = 0; l < members_.size(); ++l) {
      const bool keeps = j < kept_.size() && kept_[j] == static_cast<int>(l);
      j += keeps;
      if (!keeps) x.segment<3>(3 * members_[l]).setZero();
    }
    solve_kept(contacts, v, x);
    apply(mechanisms, x, v);
    ++result_.islands;
  }
  std::sort(result_.blocked.begin(), result_.blocked.end());
  return result_;
}

}  // namespace tether::contact::detail
