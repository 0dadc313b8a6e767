// Tether: bodies over ranks by Zoltan. SPDX-License-Identifier: BSD-3-Clause
#include <zoltan.h>

#include <stdexcept>
#include <string>
#include <tether/contact_mpi.hpp>

namespace tether::contact_mpi {
namespace {

struct Bodies {
  const std::vector<int>& numbers;
  const std::vector<Eigen::Vector3d>& centres;
  const std::vector<double>& weights;
};
const Bodies& bodies(void* data) { return *static_cast<const Bodies*>(data); }

void check(const Bodies& b) {
  if (b.centres.size() != b.numbers.size() || b.weights.size() != b.numbers.size())
    throw std::invalid_argument(std::to_string(b.numbers.size()) + " numbers of bodies, but " +
                                std::to_string(b.centres.size()) + " centres and " +
                                std::to_string(b.weights.size()) + " weights");
  for (std::size_t k = 0; k < b.numbers.size(); ++k) {
    const std::string body = "body " + std::to_string(b.numbers[k]);
    if (b.numbers[k] < 0) throw std::invalid_argument(body + ": numbers must be >= 0");
    if (!b.centres[k].allFinite()) throw std::invalid_argument(body + ": centre must be finite");
    if (!(b.weights[k] >= 0 && b.weights[k] <= 1e30))
      throw std::invalid_argument(body + ": weight must lie in 0 .. 1e30");
  }
}

// zoltan.h has these types for its callbacks.
int count(void* data, int* error) {
  *error = ZOLTAN_OK;
  return static_cast<int>(bodies(data).numbers.size());
}
void list(void* data, int, int, ZOLTAN_ID_PTR global, ZOLTAN_ID_PTR local, int, float* weights,
          int* error) {
  const Bodies& b = bodies(data);
  for (std::size_t k = 0; k < b.numbers.size(); ++k) {
    global[k] = static_cast<ZOLTAN_ID_TYPE>(b.numbers[k]);
    local[k] = static_cast<ZOLTAN_ID_TYPE>(k);
    weights[k] = static_cast<float>(b.weights[k]);
  }
  *error = ZOLTAN_OK;
}
int dimension(void*, int* error) {
  *error = ZOLTAN_OK;
  return 3;
}
void centres(void* data, int, int, int n, ZOLTAN_ID_PTR, ZOLTAN_ID_PTR local, int, double* out,
             int* error) {
  for (int k = 0; k < n; ++k)
    Eigen::Map<Eigen::Vector3d>(out + 3 * k) = bodies(data).centres[local[k]];
  *error = ZOLTAN_OK;
}

}  // namespace

std::vector<int> partition(MPI_Comm comm, const std::vector<int>& numbers,
                           const std::vector<Eigen::Vector3d>& centres_of,
                           const std::vector<double>& weights) {
  Bodies mine{numbers, centres_of, weights};
  std::exception_ptr failure;
  try {
    check(mine);
  } catch (...) {
    failure = std::current_exception();
  }
  agree(comm, failure);
  float version = 0;
  Zoltan_Initialize(0, nullptr, &version);  // MPI is running: it has no use for arguments
  Zoltan_Struct* z = Zoltan_Create(comm);
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  for (const auto& [name, value] : {std::pair{"DEBUG_LEVEL", "0"},
                                    {"LB_METHOD", "RCB"},
                                    {"NUM_GID_ENTRIES", "1"},
                                    {"NUM_LID_ENTRIES", "1"},
                                    {"OBJ_WEIGHT_DIM", "1"},
                                    {"RETURN_LISTS", "PARTS"}})
    Zoltan_Set_Param(z, name, value);
  Zoltan_Set_Num_Obj_Fn(z, count, &mine);
  Zoltan_Set_Obj_List_Fn(z, list, &mine);
  Zoltan_Set_Num_Geom_Fn(z, dimension, &mine);
  Zoltan_Set_Geom_Multi_Fn(z, centres, &mine);
  int changes = 0, gids = 0, lids = 0, imports = 0, exports = 0;
  ZOLTAN_ID_PTR import_g = nullptr, import_l = nullptr, export_g = nullptr, export_l = nullptr;
  int *import_p = nullptr, *import_t = nullptr, *export_p = nullptr, *export_t = nullptr;
  const int error =
      Zoltan_LB_Partition(z, &changes, &gids, &lids, &imports, &import_g, &import_l, &import_p,
                          &import_t, &exports, &export_g, &export_l, &export_p, &export_t);
  std::vector<int> out(numbers.size(), rank);
  for (int k = 0; k < exports; ++k) out[export_l[k]] = export_t[k];
  Zoltan_LB_Free_Part(&import_g, &import_l, &import_p, &import_t);
  Zoltan_LB_Free_Part(&export_g, &export_l, &export_p, &export_t);
  Zoltan_Destroy(&z);
  if (error != ZOLTAN_OK && error != ZOLTAN_WARN)
    failure = std::make_exception_ptr(
        std::runtime_error("Zoltan_LB_Partition returned " + std::to_string(error)));
  agree(comm, failure);
  return out;
}

}  // namespace tether::contact_mpi
