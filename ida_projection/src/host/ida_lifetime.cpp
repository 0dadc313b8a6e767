// Tether: whether the host's ida_mem is still there. SPDX-License-Identifier: BSD-3-Clause
#include "host/ida_lifetime.hpp"

#include <algorithm>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

namespace tether::ida_projection {

namespace {

/// A watched vector, its own operations, and the observers of its end.
struct Watched {
  N_Vector vector;
  void (*destroy)(N_Vector);
  N_Vector (*clone)(N_Vector);
  N_Vector (*clone_empty)(N_Vector);
  std::vector<IdaLifetime*> watchers;
  std::vector<SUNNonlinearSolver> solvers;  // to be freed with it

  void restore(N_Vector v) const {
    v->ops->nvdestroy = destroy;
    v->ops->nvclone = clone;
    v->ops->nvcloneempty = clone_empty;
  }
};

std::mutex& guard() {
  static std::mutex mutex;
  return mutex;
}
std::vector<Watched>& watched() {
  static std::vector<Watched> all;
  return all;
}
std::vector<Watched>::iterator find(N_Vector v) {
  return std::find_if(watched().begin(), watched().end(),
                      [v](const Watched& w) { return w.vector == v; });
}

}  // namespace

void IdaLifetime::watch(N_Vector one, N_Vector other, std::function<void()> at_end) {
  if (one == nullptr || other == nullptr || one->ops == other->ops) return;
  const std::lock_guard<std::mutex> lock(guard());
  at_end_ = std::move(at_end);
  const auto entry = find(one);
  if (entry != watched().end()) {
    entry->watchers.push_back(this);
  } else {
    const N_Vector_Ops own = one->ops;
    watched().push_back({one, own->nvdestroy, own->nvclone, own->nvcloneempty, {this}, {}});
    replace(one);
  }
  vector_ = one;
}

IdaLifetime::~IdaLifetime() {
  if (vector_ == nullptr) return;
  const std::lock_guard<std::mutex> lock(guard());
  const auto entry = find(vector_);
  auto& watchers = entry->watchers;
  watchers.erase(std::remove(watchers.begin(), watchers.end(), this), watchers.end());
  if (!watchers.empty() || !entry->solvers.empty()) return;
  entry->restore(vector_);
  watched().erase(entry);
}

void IdaLifetime::free_at_end(SUNNonlinearSolver solver) const noexcept {
  if (over_) {
    SUNNonlinSolFreeEmpty(solver);
  } else if (alive()) {
    const std::lock_guard<std::mutex> lock(guard());
    try {
      find(vector_)->solvers.push_back(solver);
    } catch (const std::bad_alloc&) {  // it stays
    }
  }
}

void IdaLifetime::destroy(N_Vector v) {
  Watched entry{};
  {
    const std::lock_guard<std::mutex> lock(guard());
    const auto found = find(v);
    entry = std::move(*found);
    watched().erase(found);
  }
  for (IdaLifetime* watcher : entry.watchers) {
    watcher->at_end_();
    watcher->vector_ = nullptr;
    watcher->over_ = true;
  }
  for (SUNNonlinearSolver solver : entry.solvers) SUNNonlinSolFreeEmpty(solver);
  entry.restore(v);
  entry.destroy(v);
}

// A clone copies the table, half-made ones too: meanwhile the vector has its own operations.
template <N_Vector (*_generic_N_Vector_Ops::*Clone)(N_Vector)>
N_Vector IdaLifetime::clone_by(N_Vector v) {
  const std::lock_guard<std::mutex> lock(guard());
  find(v)->restore(v);
  N_Vector made = (v->ops->*Clone)(v);
  replace(v);
  return made;
}

void IdaLifetime::replace(N_Vector v) {
  v->ops->nvdestroy = destroy;
  v->ops->nvclone = clone_by<&_generic_N_Vector_Ops::nvclone>;
  if (v->ops->nvcloneempty != nullptr)
    v->ops->nvcloneempty = clone_by<&_generic_N_Vector_Ops::nvcloneempty>;
}

}  // namespace tether::ida_projection
