// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tether::contact::detail {

// How a contact is solved: alone, or in fours that have no moving body in common. A chunk holds its
// contacts in this order.
enum class Kind : std::uint8_t { general4, sphere4, general, sphere, smooth };
constexpr int kKinds = 5;

// Contacts that one thread sweeps in one go: place .. place of the next chunk. Bodies of a chunk
// are near each other, so that they stay in the cache.
struct Chunk {
  int place;          // among all contacts in the order of sweeping
  int begin[kKinds];  // the same within the contacts of each kind
};

// A connected component over bodies that move. Nothing about it depends on other islands.
struct Island {
  int contacts, contact_begin;  // places
  int body_begin, body_end;     // slots
  int chunk_begin, chunk_end;
  int colour_begin, colour_end;  // into ContactGraph::colours
};

// Keeps its storage between calls of build().
//
// Order: islands one after the other; chunks by colour, such that chunks of a colour have no moving
// body in common: they may be swept at the same time and give the same bits as one after the other.
// Within a chunk, contacts that share no body are put together in fours where that is possible.
class ContactGraph {
 public:
  // first[i] moves, second[i] moves or is -1; kind[i] is general, sphere or smooth.
  void build(int bodies, const std::vector<int>& first, const std::vector<int>& second,
             const std::vector<Kind>& kind, bool in_fours);

  std::vector<int> order;      // place -> contact
  std::vector<float> coupled;  // place -> contacts with a moving body in common, itself included
  std::vector<int> slot;       // body -> slot; -1: fixed or without contact
  std::vector<int> body;       // slot -> body
  std::vector<Chunk> chunks;   // and one behind the last
  std::vector<int> colours;    // first chunk of each colour; one behind the last of each island
  std::vector<Island> islands;

  // Bytes of storage that grow with the contacts, and with the bodies.
  std::size_t contact_bytes() const;
  std::size_t body_bytes() const;

 private:
  int root(int b);
  void find_islands(int bodies);
  void one_chunk(Island& island);
  void cluster(Island& island);
  void colour_chunks(Island& island);
  void count_coupled();
  void order_within(const int* begin, const int* end, int place);
  void group(const int* begin, const int* end);

  const std::vector<int>* first_ = nullptr;
  const std::vector<int>* second_ = nullptr;
  const std::vector<Kind>* kind_ = nullptr;
  std::vector<int> parent_;                     // body -> union-find parent
  std::vector<int> island_of_;                  // body (root) -> island
  std::vector<int> sorted_;                     // contacts by island, later by chunk
  std::vector<int> adjacent_start_, adjacent_;  // body -> contacts
  std::vector<int> between_;                    // body -> contacts with the body looked at
  std::vector<float> count_;                    // contact -> coupled
  std::vector<char> taken_;                     // contact -> in a cluster
  std::vector<int> chunk_start_;                // chunk -> contacts
  std::vector<int> chunk_colour_, by_colour_, sequence_;
  std::vector<int> mark_;             // body -> last cluster that has seen it
  std::vector<int> near_, far_;       // queues of bodies
  std::vector<std::uint64_t> used_;   // body -> colours
  std::vector<int> by_kind_[kKinds];  // contacts of one chunk
  bool in_fours_ = false;
};

}  // namespace tether::contact::detail
