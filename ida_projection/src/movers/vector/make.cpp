// Tether: rows that need no more of a vector than its operations. SPDX-License-Identifier:
// BSD-3-Clause
#include "movers/vector/distributed_store.hpp"
#include "movers/vector/gradient_store.hpp"
#include "movers/vector/vector_rows.hpp"

namespace tether::ida_projection {

std::unique_ptr<Mover> make_vector_mover(const Constraints& constraints, const Options& options,
                                         Statistics& statistics, N_Vector like) {
  std::unique_ptr<RowsAt> rows;
  if (std::holds_alternative<UserProjection>(constraints.jacobian))
    rows = make_user_rows(constraints, options, statistics, like);
  else if (std::holds_alternative<DistributedRows>(constraints.jacobian))
    rows = std::make_unique<VectorRows<DistributedStore>>(constraints, options, statistics, like);
  else
    rows = std::make_unique<VectorRows<GradientStore>>(constraints, options, statistics, like);
  return std::make_unique<Mover>(options, std::move(rows));
}

}  // namespace tether::ida_projection
