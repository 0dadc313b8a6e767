// Tether: contacts, limits, motors and moments of bodies as a product of cones.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <tether/contact/body_solver.hpp>
#include <tether/contact/cones.hpp>
#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

#include "joints/mechanisms.hpp"

namespace tether::contact::detail {

/// One factor of the product, by its rows on its bodies: w = sum of J v + bias + compliance x.
struct BodyCone {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 6, 6>;
  using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;
  struct Term {
    int body;
    Rows J;
  };

  explicit BodyCone(const Cone& of) : cone(of), bias(Column::Zero(of.rows)) {}

  Cone cone;
  std::vector<Term> terms;
  Column bias;
  double compliance = 0;  ///< velocity over impulse, of every row
};

/// A contact that may hold moments beside its force: |moment_t| <= rolling x_n about axes in the
/// surface, |moment_n| <= torsional x_n about the normal. Rows in its frame: the relative velocity
/// at the point, and the relative angular velocities about the axes of its moments.
BodyCone contact_cone(const PointContact& contact, double rolling = 0, double torsional = 0);

/// Puts tangents of other lengths into the rows of a contact_cone: its slip and friction are those
/// of an elliptic cone then (method, section 8).
void scale_tangents(const std::array<Eigen::Vector3d, 2>& tangents, const PointContact& contact,
                    BodyCone& cone);

/// Solves cones of bodies island by island. Joints are eliminated by the sparse factors of
/// G M^-1 G' (linalg::SparseMinimumNorm), so that cones see
///
///     A = J P J',   P = M^-1 - M^-1 G' (G M^-1 G')^+ G M^-1
///
/// A contact whose normal velocity the joints hold (A_nn = 0) has no impulse: it is left out where
/// it does not approach, else named in Result::blocked. A is dense over the contacts of a
/// mechanism.
class BodyCones {
 public:
  explicit BodyCones(const Options& options) { set_options(options); }
  void set_options(const Options& options) {
    options_ = options;
    solver_ = ConeSolver(options);
  }

  struct Result {
    Status status = Status::solved;
    double error = 0;
    int islands = 0, failed = 0;
    int sweeps = 0;            ///< the most of any island
    std::vector<int> blocked;  ///< ascending
  };
  /// v must meet the joints; it is changed by the impulses found and by those of the joints, so
  /// that it still does. The latter are added to the pulls. x, cone by cone: start in, impulses
  /// out.
  const Result& solve(Mechanisms& mechanisms, const std::vector<BodyCone>& cones,
                      std::vector<Vector6d>& v, linalg::VectorX& x);

 private:
  using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  /// A moving body of a cone and the cone's rows on its u. node: number of its mechanism, or the
  /// number of mechanisms plus that of a body without one. place: index of the cone in members_.
  struct Side {
    int place, body, node;
    BodyCone::Rows H;
  };
  struct Entry {  // of A, by place, row >= column
    int row, column;
    Block value;
  };
  /// A direction of slip or of a moment that the joints hold.
  struct Held {
    int place, from, count;
    Eigen::Vector2d direction;
  };
  int node_of(const Mechanisms& mechanisms, int body) const {
    const int m = mechanisms.mechanism_of(body);
    return m >= 0 ? m : mechanisms.count() + body;
  }
  void find_islands(const Mechanisms& mechanisms, const std::vector<BodyCone>& cones);
  bool collect_sides(const Mechanisms& mechanisms, const std::vector<BodyCone>& cones);
  void assemble(Mechanisms& mechanisms, const std::vector<BodyCone>& cones);
  void add_mechanism(Mechanisms& mechanisms, std::size_t begin, std::size_t end);
  void leave_out_held(const std::vector<BodyCone>& cones, const std::vector<Vector6d>& v);
  Eigen::VectorXd approach(int place, const BodyCone& cone, const std::vector<Vector6d>& v) const;
  void solve_island(const std::vector<BodyCone>& cones, const std::vector<Vector6d>& v,
                    bool jointed, linalg::VectorX& x);
  void apply(Mechanisms& mechanisms, const linalg::VectorX& x, std::vector<Vector6d>& v);

  Options options_;
  ConeSolver solver_;
  Result result_;
  linalg::DisjointSets sets_;       // of cones
  std::vector<int> row_;            // of each cone: its first row in x
  std::vector<int> first_on_;       // of each node: its first cone
  std::vector<int> order_, start_;  // cones island by island
  // The present island: its cones, which of them are solved, their sides, A, and the diagonal of A
  // without joints by cone and row.
  std::vector<int> members_;
  std::vector<char> kept_;
  std::vector<Side> sides_;
  std::vector<Entry> A_;
  std::vector<BodyCone::Column> alone_;
  std::vector<Held> held_;
  Eigen::MatrixXd response_;
};

}  // namespace tether::contact::detail
