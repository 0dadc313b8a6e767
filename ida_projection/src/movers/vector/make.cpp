// Tether: movers that need no more of a vector than its operations. SPDX-License-Identifier:
// BSD-3-Clause
#include "movers/vector/distributed_store.hpp"
#include "movers/vector/gradient_store.hpp"
#include "movers/vector/vector_mover.hpp"

namespace tether::ida_projection {

std::unique_ptr<Mover> make_vector_mover(const Constraints& constraints, const Options& options,
                                         Statistics& statistics, N_Vector like) {
  if (std::holds_alternative<UserProjection>(constraints.jacobian))
    return make_user_mover(constraints, options, statistics, like);
  if (std::holds_alternative<DistributedRows>(constraints.jacobian))
    return std::make_unique<VectorMover<DistributedStore>>(constraints, options, statistics, like);
  return std::make_unique<VectorMover<GradientStore>>(constraints, options, statistics, like);
}

}  // namespace tether::ida_projection
