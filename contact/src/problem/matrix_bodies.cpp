// Tether: the bodies behind a Delassus matrix. SPDX-License-Identifier: BSD-3-Clause
#include "problem/body_form.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tether/linalg/index.hpp>

namespace tether::contact::detail {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using linalg::at;

constexpr double kRank = 1e-12;  // of the diagonal of A: what rounding leaves of dependent rows

/// Columns G of a Cholesky decomposition of S, given by its diagonal and column(k), whose pivots
/// are the largest of the first `most` rows, to their rank: diagonals below `least` are rounding.
template <typename Column>
MatrixXd pivoted_cholesky(VectorXd left, Eigen::Index most, const VectorXd& least,
                          const Column& column, std::vector<int>* pivots = nullptr) {
  MatrixXd G(left.size(), std::min(most, Eigen::Index{6}));
  Eigen::Index rank = 0;
  for (; rank < most; ++rank) {
    Eigen::Index p;
    const double largest = left.head(most).maxCoeff(&p);
    if (!(largest > least[p])) break;
    if (rank == G.cols()) G.conservativeResize(Eigen::NoChange, std::min(most, 2 * rank));
    G.col(rank) =
        (column(p) - G.leftCols(rank) * G.row(p).head(rank).transpose()) / std::sqrt(largest);
    left -= G.col(rank).cwiseAbs2();
    left[p] = 0;
    if (pivots != nullptr) pivots->push_back(static_cast<int>(p));
  }
  return G.leftCols(rank);
}

class MatrixBodies {
 public:
  explicit MatrixBodies(const Problem& problem) : problem_(problem) { find_classes(); }

  bool have_fewer_velocities() const {
    // Two contacts have as many velocities as two bodies.
    return 2 * classes_.size() <= at(problem_.contacts());
  }
  BodyForm find() {
    rows_of_.resize(at(problem_.contacts()));
    for (std::size_t c = 0; c < classes_.size(); ++c) find_rows(static_cast<int>(c));
    for (std::size_t c = 0; c < classes_.size(); ++c) find_blocks(static_cast<int>(c));
    while (!open_.empty()) eliminate(next());
    return form();
  }

 private:
  /// Contacts with the same neighbours.
  struct Class {
    std::vector<int> contacts;
    MatrixXd basis;                // all rows of the contacts by those that determine them
    VectorXd diagonal;             // of A, in these
    std::map<int, MatrixXd> left;  // blocks with other classes that are not eliminated yet
    std::vector<int> neighbours() const {
      std::vector<int> out;
      for (const auto& [other, block] : left) out.push_back(other);
      return out;
    }
  };
  /// A row that others are determined by: its component and its place in the class.
  struct Row {
    int component, place;
  };
  /// The elimination of the first classes of a clique.
  struct Turn {
    std::vector<int> classes;
    std::vector<Eigen::Index> start{0};  // rows of each
    std::size_t eliminated = 0;
    MatrixXd G, left;
    bool takes_body = true;  // the others are not coupled by what is left
    auto block(std::size_t r, std::size_t k) {
      return left.block(start[r], start[k], start[r + 1] - start[r], start[k + 1] - start[k]);
    }
  };

  void find_classes() {
    std::map<std::vector<int>, int> number;
    std::vector<int> columns;
    for (int i = 0; i < problem_.contacts(); ++i) {
      columns.clear();
      for (int k = problem_.row_start()[at(i)]; k < problem_.row_start()[at(i + 1)]; ++k)
        if (!is_zero(problem_.blocks()[at(k)])) columns.push_back(problem_.columns()[at(k)]);
      const auto [place, is_new] = number.emplace(columns, static_cast<int>(classes_.size()));
      if (is_new) classes_.emplace_back();
      classes_[at(place->second)].contacts.push_back(i);
      class_of_.push_back(place->second);
    }
  }

  void find_rows(int number) {
    Class& c = classes_[at(number)];
    const MatrixXd A = problem_.part(c.contacts).dense_matrix();
    const VectorXd diagonal = A.diagonal();
    std::vector<int> rows;
    const MatrixXd G = pivoted_cholesky(
        diagonal, diagonal.size(), VectorXd::Constant(diagonal.size(), kRank * diagonal.maxCoeff()),
        [&](Eigen::Index row) { return A.row(row).transpose(); }, &rows);
    MatrixXd determining(G.cols(), G.cols());  // lower triangular
    c.diagonal.resize(G.cols());
    for (Eigen::Index r = 0; r < G.cols(); ++r) {
      const int row = rows[at(static_cast<int>(r))];
      determining.row(r) = G.row(row);
      c.diagonal[r] = diagonal[row];
      rows_of_[at(c.contacts[at(row / 3)])].push_back({row % 3, static_cast<int>(r)});
    }
    c.basis =
        determining.transpose().triangularView<Eigen::Upper>().solve(G.transpose()).transpose();
  }

  void find_blocks(int number) {
    Class& c = classes_[at(number)];
    open_.insert(number);
    changed_.insert(number);
    for (int i : c.contacts) {
      if (rows_of_[at(i)].empty()) continue;
      int last = -1;
      MatrixXd* block = nullptr;  // with it
      for (int k = problem_.row_start()[at(i)]; k < problem_.row_start()[at(i + 1)]; ++k) {
        const int j = problem_.columns()[at(k)], other = class_of_[at(j)];
        if (rows_of_[at(j)].empty() || is_zero(problem_.blocks()[at(k)])) continue;
        if (other != last) block = &c.left[last = other];
        if (block->size() == 0)
          block->setZero(c.diagonal.size(), classes_[at(other)].diagonal.size());
        const auto A = as_matrix(problem_.blocks()[at(k)]);
        for (const Row& row : rows_of_[at(i)])
          for (const Row& column : rows_of_[at(j)])
            (*block)(row.place, column.place) = A(row.component, column.component);
      }
    }
  }

  /// Pairs of neighbours that an elimination would couple.
  long fill(const Class& c) const {
    const std::vector<int> near = c.neighbours();
    long out = 0;
    for (int d : near)
      for (int e : near) out += d < e && classes_[at(d)].left.count(e) == 0 ? 1 : 0;
    return out;
  }

  /// With all classes that have the neighbours of this one.
  Turn turn(const Class& c) const {
    Turn out;
    const std::vector<int> near = c.neighbours();
    for (bool same : {true, false}) {
      for (int d : near)
        if ((classes_[at(d)].neighbours() == near) == same) out.classes.push_back(d);
      if (same) out.eliminated = out.classes.size();
    }
    for (int d : out.classes)
      out.start.push_back(out.start.back() + classes_[at(d)].diagonal.size());
    MatrixXd S = MatrixXd::Zero(out.start.back(), out.start.back());
    VectorXd diagonal(out.start.back());
    for (std::size_t r = 0; r < out.classes.size(); ++r) {
      const Class& d = classes_[at(out.classes[r])];
      diagonal.segment(out.start[r], d.diagonal.size()) = d.diagonal;
      for (std::size_t k = 0; k < out.classes.size(); ++k) {
        const auto block = d.left.find(out.classes[k]);
        if (block == d.left.end()) continue;
        S.block(out.start[r], out.start[k], block->second.rows(), block->second.cols()) =
            block->second;
      }
    }
    out.G = pivoted_cholesky(S.diagonal(), out.start[out.eliminated], kRank * diagonal,
                             [&](Eigen::Index k) { return S.col(k); });
    out.left = S - out.G * out.G.transpose();
    drop_rounding(out);
    return out;
  }

  void drop_rounding(Turn& turn) const {
    const auto size = [&](std::size_t k) {
      return classes_[at(turn.classes[k])].diagonal.maxCoeff();
    };
    for (std::size_t r = turn.eliminated; r < turn.classes.size(); ++r)
      for (std::size_t k = turn.eliminated; k < turn.classes.size(); ++k) {
        if (r == k) continue;
        auto block = turn.block(r, k);
        if (block.cwiseAbs().maxCoeff() > std::sqrt(kRank) * std::sqrt(size(r) * size(k)))
          turn.takes_body = false;
        else
          block.setZero();
      }
  }

  /// A class that takes a body away; where there is none, one that couples few others anew.
  Turn next() {
    while (!changed_.empty()) {
      const int c = *changed_.begin();
      changed_.erase(changed_.begin());
      if (open_.count(c) == 0 || fill(classes_[at(c)]) > 0) continue;
      Turn out = turn(classes_[at(c)]);
      if (out.takes_body) return out;
    }
    return turn(classes_[at(*std::min_element(open_.begin(), open_.end(), [&](int c, int d) {
      return fill(classes_[at(c)]) < fill(classes_[at(d)]);
    }))]);
  }

  void eliminate(Turn turn) {
    for (std::size_t r = 0; r < turn.eliminated; ++r) {
      const int gone = turn.classes[r];
      for (int d : turn.classes) classes_[at(d)].left.erase(gone);
      open_.erase(gone);
    }
    for (std::size_t r = turn.eliminated; r < turn.classes.size(); ++r) {
      Class& c = classes_[at(turn.classes[r])];
      for (std::size_t k = turn.eliminated; k < turn.classes.size(); ++k) {
        const auto block = turn.block(r, k);
        if (r != k && (block.array() == 0).all())
          c.left.erase(turn.classes[k]);
        else
          c.left[turn.classes[k]] = block;
      }
      for (const auto& [d, block] : c.left) changed_.insert(d);
    }
    turn.left.resize(0, 0);
    turns_.push_back(std::move(turn));
  }

  BodyForm form() const {
    struct Entry {
      int node;
      PackedBlock block;
    };
    std::vector<std::vector<Entry>> rows(class_of_.size());
    BodyForm out;
    for (const Turn& turn : turns_) {
      const Eigen::Index rank = turn.G.cols();
      for (std::size_t k = 0; k < turn.classes.size(); ++k) {
        const Class& c = classes_[at(turn.classes[k])];
        const MatrixXd H = c.basis * turn.G.middleRows(turn.start[k], c.diagonal.size());
        for (Eigen::Index m = 0; 3 * m < H.rows(); ++m)
          for (Eigen::Index first = 0; first < rank; first += 3) {
            PackedBlock block;
            for (Eigen::Index j = first; j < std::min(rank, first + 3); ++j)
              for (Eigen::Index r = 0; r < 3; ++r)
                block.column[4 * (j - first) + r] = H(3 * m + r, j);
            if (is_zero(block)) continue;
            const int node = out.nodes + static_cast<int>(first / 3);
            rows[at(c.contacts[at(static_cast<int>(m))])].push_back({node, block});
          }
      }
      out.nodes += static_cast<int>((rank + 2) / 3);
    }
    for (const std::vector<Entry>& row : rows) {
      for (const Entry& entry : row) out.add(entry.node, entry.block);
      out.end_contact();
    }
    return out;
  }

  const Problem& problem_;
  std::vector<Class> classes_;
  std::vector<int> class_of_;              // of each contact
  std::vector<std::vector<Row>> rows_of_;  // of each contact, those that determine others
  std::set<int> open_, changed_;           // not eliminated; with other neighbours than before
  std::vector<Turn> turns_;
};

/// A Z = H H' Z for columns Z of signs, as far as refinement needs: half of all such columns show a
/// difference (Freivalds, 1977).
bool explains(const BodyForm& form, const Problem& problem) {
  using Columns = Eigen::Matrix<double, 3, 4>;
  const std::size_t n = at(problem.contacts());
  const auto root = [&](std::size_t i) {
    const LocalBlock& local = problem.locals()[i];
    return std::sqrt(std::max({local.a, local.T[0], local.T[2]}));
  };
  std::minstd_rand signs(1);
  std::vector<Columns> Z(n), P(at(form.nodes), Columns::Zero());
  for (std::size_t i = 0; i < n; ++i) {
    for (double& z : Z[i].reshaped()) z = (signs() < signs.max() / 2 ? 1 : -1) / root(i);
    for (int k = form.start[i]; k < form.start[i + 1]; ++k)
      P[at(form.node[at(k)])] += as_matrix(form.H[at(k)]).transpose() * Z[i];
  }
  for (std::size_t i = 0; i < n; ++i) {
    Columns left = Columns::Zero();
    const int first = problem.row_start()[i], end = problem.row_start()[i + 1];
    for (int k = first; k < end; ++k)
      left += as_matrix(problem.blocks()[at(k)]) * Z[at(problem.columns()[at(k)])];
    for (int k = form.start[i]; k < form.start[i + 1]; ++k)
      left -= as_matrix(form.H[at(k)]) * P[at(form.node[at(k)])];
    // Contacts at nearly the same point leave up to 1e-5 of A, and refinement finds all digits in
    // as many steps.
    if (!(left.cwiseAbs().maxCoeff() <= 1e-4 * root(i) * (end - first))) return false;
  }
  return true;
}

}  // namespace

bool may_have_bodies(const Problem& problem) {
  return problem.dimension() == 3 && MatrixBodies(problem).have_fewer_velocities();
}

std::shared_ptr<const BodyForm> bodies_of_matrix(const Problem& problem) {
  if (problem.dimension() != 3) return nullptr;
  const auto form = std::make_shared<const BodyForm>(MatrixBodies(problem).find());
  return explains(*form, problem) ? form : nullptr;
}

}  // namespace tether::contact::detail
