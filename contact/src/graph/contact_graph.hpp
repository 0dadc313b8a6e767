// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "graph/graph_parts.hpp"

namespace tether::contact::detail {

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

 private:
  void one_chunk(Island& island);
  void many_chunks(Island& island);
  void append_chunk(const int* begin, const int* end, int place);

  ContactPairs pairs_;
  const std::vector<Kind>* kind_ = nullptr;
  bool in_fours_ = false;
  std::vector<int> sorted_;          // contacts by island, later by chunk
  std::vector<std::uint64_t> used_;  // body -> colours of its chunks, then open fours
  IslandFinder finder_;
  Adjacency adjacent_;
  Clusters clusters_;
  ChunkColours chunk_colours_;
  ContactsByKind by_kind_;
};

}  // namespace tether::contact::detail
