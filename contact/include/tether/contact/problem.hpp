// Tether: a frictional contact problem given by its Delassus matrix. SPDX-License-Identifier:
// BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <tether/contact/one_contact.hpp>
#include <tether/export.hpp>
#include <tether/linalg/block3.hpp>
#include <tether/linalg/eigen.hpp>
#include <utility>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::contact {

namespace detail {
struct BodyForm;
}

using linalg::PackedBlock;
using linalg::PackedVector;

/// 3 x 3 block of A between two contacts, counted from 0; 1/kg.
struct MatrixBlock {
  int row = 0, column = 0;                          ///< contacts
  Eigen::Matrix3d value = Eigen::Matrix3d::Zero();  ///< planar: the upper left 2x2 part counts
};

/// Contacts i = 0 .. n-1 with components (normal, tangent, tangent) or, in the plane,
/// (normal, tangent): relative velocities w = A x - b after impulses x, friction coefficients mu_i.
/// A = J M^-1 J' may be singular and slightly unsymmetric: residuals use it as given, one-contact
/// solves use the symmetric part of its diagonal blocks. A value; fixed once made.
class Problem {
 public:
  Problem() = default;
  /// d n x d n matrix, d n vector, n coefficients; d = 2 or 3 follows from the sizes.
  /// Throws std::invalid_argument (here and below) on sizes that do not match, values that are not
  /// finite, A_nn <= 0, indefinite diagonal blocks, mu < 0.
  static Problem dense(const linalg::MatrixView& A, const linalg::VectorView& b,
                       const linalg::VectorView& mu);
  /// Blocks in any order; equal positions are summed.
  static Problem sparse(int dimension, std::vector<MatrixBlock> blocks, const linalg::VectorView& b,
                        const linalg::VectorView& mu);

  /// Number of contacts.
  int contacts() const { return static_cast<int>(local_.size()); }
  int dimension() const { return dimension_; }  ///< 3, or 2 in the plane
  /// By contact, then component; m/s.
  const linalg::VectorX& b() const { return b_; }
  /// Coefficient of friction of a contact.
  double mu(int contact) const { return local_[static_cast<std::size_t>(contact)].mu; }
  /// Factors of the diagonal block of a contact.
  const LocalBlock& local(int contact) const { return local_[static_cast<std::size_t>(contact)]; }
  linalg::MatrixX dense_matrix() const;  ///< A, dimension * contacts rows

  /// A by block rows, columns ascending, pattern symmetric, diagonal present. Those of row i are
  /// row_start()[i] .. row_start()[i + 1] - 1 of columns() and blocks().
  const std::vector<int>& row_start() const { return row_start_; }
  const std::vector<int>& columns() const { return columns_; }        ///< see row_start()
  const std::vector<PackedBlock>& blocks() const { return blocks_; }  ///< see row_start()
  const std::vector<LocalBlock>& locals() const { return local_; }    ///< local() of each contact
  const std::vector<PackedVector>& packed_b() const { return packed_b_; }  ///< pack(b())
  /// The same in other units, exactly: in island k, A times 2^mass[k] and b times 2^speed[k].
  Problem rescaled(const std::vector<int>& mass, const std::vector<int>& speed) const;
  /// Some contacts alone. std::invalid_argument where they do not ascend within the problem.
  Problem part(const std::vector<int>& contacts) const;
  /// Island of each contact: contacts with a block that is not zero between them share one.
  /// Numbered from 0 in the order of their first contacts.
  const std::vector<int>& islands() const { return islands_; }

  /// Its factors where delassus() has made it, else null; the solver's own.
  const detail::BodyForm* body_form() const { return body_form_.get(); }
  /// For delassus().
  void set_body_form(std::shared_ptr<const detail::BodyForm> form) { body_form_ = std::move(form); }

  /// dimension * contacts entries as one padded vector a contact.
  std::vector<PackedVector> pack(const linalg::VectorView& x) const;
  /// The reverse of pack().
  void unpack(const std::vector<PackedVector>& x, linalg::VectorX& out) const;

 private:
  int dimension_ = 3;
  linalg::VectorX b_;
  std::vector<LocalBlock> local_;
  std::vector<int> row_start_, columns_, islands_;
  std::vector<PackedBlock> blocks_;
  std::vector<PackedVector> packed_b_;
  std::shared_ptr<const detail::BodyForm> body_form_;
};

}  // namespace tether::contact
TETHER_EXPORT_END
