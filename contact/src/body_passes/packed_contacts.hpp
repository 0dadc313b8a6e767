// Tether: contacts as the kernels want them. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/body_solver.hpp>
#include <vector>

#include "graph/graph_parts.hpp"
#include "kernels/body_contacts.hpp"
#include "problem/contact_side.hpp"

namespace tether::contact::detail {

// One list for each kind. A contact is found by its kind and its place among the contacts of that
// kind (Chunk::begin).
class PackedContacts {
 public:
  // end: the chunk behind the last.
  void resize(const Chunk& end, std::size_t contacts);

  // The block of a contact between the bodies a and b of the kernels, impulse zero. Returns T/a of
  // the tangents that friction moves, 0 without friction. Throws std::invalid_argument if the
  // bodies cannot move along the normal.
  double pack(Kind k, int place, const Side& side, const PointContact& c, int a, int b);

  // World axes, on the body `a`.
  Vector3d impulse(Kind k, int place) const;
  void set_impulse(Kind k, int place, const Vector3d& p);
  // All that a sweep changes of a contact, as the kernels have it: for another process.
  Eigen::Vector4d state(Kind k, int place) const;
  void set_state(Kind k, int place, const Eigen::Vector4d& s);
  // Momentum of the contacts of chunks from .. to.
  void extrapolate(const Chunk& from, const Chunk& to, double beta);

  // operation(begin, end, width): the contacts of a kind, `width` in each entry, for the kinds that
  // a chunk has, in their order.
  template <class Operation>
  void for_kinds(const Chunk& from, const Chunk& to, const Operation& operation) {
    const auto kind_range = [&](auto& list, Kind k, int width) {
      const int begin = from.begin[static_cast<int>(k)] / width;
      const int end = to.begin[static_cast<int>(k)] / width;
      if (begin < end) operation(list.data() + begin, list.data() + end, width);
    };
    kind_range(general4_, Kind::general4, 4);
    kind_range(spheres4_, Kind::sphere4, 4);
    kind_range(general_, Kind::general, 1);
    kind_range(spheres_, Kind::sphere, 1);
    kind_range(smooth_, Kind::smooth, 1);
  }

  bool has_general() const { return !(general_.empty() && general4_.empty()); }

 private:
  GeneralContact general(Kind k, int place) const;
  SphereContact sphere(Kind k, int place) const;
  void put(const GeneralContact& c, Kind k, int place);
  void put(const SphereContact& c, Kind k, int place);

  std::vector<GeneralGroup> general4_;
  std::vector<SphereGroup> spheres4_;
  std::vector<GeneralContact> general_;
  std::vector<SphereContact> spheres_;
  std::vector<SmoothContact> smooth_;
  std::vector<double> previous_;  // impulses at the last extrapolation, three for each place
};

}  // namespace tether::contact::detail
