// Tether: islands of bodies in contact, and the order in which their contacts are swept.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <tether/linalg/disjoint_sets.hpp>
#include <vector>

namespace tether::contact::detail {

// How a contact is solved: alone, or in fours that have no moving body in common. A chunk holds its
// contacts in this order.
enum class Kind : std::uint8_t { general4, sphere4, general, sphere, smooth };
constexpr int kKinds = static_cast<int>(Kind::smooth) + 1;

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

// The bodies of each contact, as given: first moves, second moves or is -1.
struct ContactPairs {
  const std::vector<int>* first = nullptr;
  const std::vector<int>* second = nullptr;
  int one(int contact) const { return (*first)[static_cast<std::size_t>(contact)]; }
  int other(int contact) const { return (*second)[static_cast<std::size_t>(contact)]; }
  int across(int contact, int body) const {
    return one(contact) == body ? other(contact) : one(contact);
  }
  int size() const { return static_cast<int>(first->size()); }
};

// Connected components.
class IslandFinder {
 public:
  // Counts and places of the islands; contacts sorted by island; the island of each contact.
  void find(int bodies, const ContactPairs& pairs, std::vector<Island>& islands,
            std::vector<int>& sorted, std::vector<int>& island_of_contact);

 private:
  linalg::DisjointSets sets_;   // of bodies
  std::vector<int> island_of_;  // body (root) -> island
};

// The contacts of each body.
class Adjacency {
 public:
  void build(int bodies, const ContactPairs& pairs);
  int count(int body) const { return static_cast<int>(end(body) - begin(body)); }
  const int* begin(int body) const { return all_.data() + start_[static_cast<std::size_t>(body)]; }
  const int* end(int body) const {
    return all_.data() + start_[static_cast<std::size_t>(body) + 1];
  }
  // For each contact in `order`: the number of contacts that share a moving body, itself included.
  void coupled(const ContactPairs& pairs, const std::vector<int>& bodies,
               const std::vector<int>& order, std::vector<float>& out);

 private:
  std::vector<int> start_, all_;
  std::vector<int> between_;  // body -> contacts with the present body
  std::vector<float> count_;  // contact -> coupled
};

// Breadth-first balls: a cluster grows from its seed until it has enough contacts; bodies that it
// leaves at its rim become seeds. A contact belongs to the first cluster that reaches it.
class Clusters {
 public:
  void reset(int bodies, int contacts);
  // Puts the contacts of an island into the order of its clusters, and gives its bodies slots.
  void find(const Island& island, const ContactPairs& pairs, const Adjacency& adjacent,
            int* contacts, std::vector<int>& slot, std::vector<int>& body);
  int size() const { return static_cast<int>(start_.size()) - 1; }
  int begin(int cluster) const { return start_[static_cast<std::size_t>(cluster)]; }
  int end(int cluster) const { return begin(cluster + 1); }

 private:
  std::vector<char> taken_;      // contact -> in a cluster
  std::vector<int> start_;       // cluster -> contacts
  std::vector<int> mark_;        // body -> last cluster that has seen it
  std::vector<int> near_, far_;  // queues of bodies
};

// Greedy: of the colours that none of the chunk's bodies has, the one with the fewest contacts, so
// that no colour is too small to be shared among threads.
class ChunkColours {
 public:
  // used: of each body a mask, 0 at first.
  void colour(const Clusters& clusters, const ContactPairs& pairs, const int* contacts,
              std::vector<std::uint64_t>& used);
  // Clusters, colour by colour.
  const std::vector<int>& sequence() const { return sequence_; }
  int of(int cluster) const { return colour_[static_cast<std::size_t>(cluster)]; }

 private:
  std::vector<int> colour_, begin_, sequence_;
};

// The contacts of a chunk by kind, those that share no moving body in fours.
class ContactsByKind {
 public:
  void sort(const int* begin, const int* end, const ContactPairs& pairs,
            const std::vector<Kind>& kind, bool in_fours, std::vector<std::uint64_t>& used);
  const std::vector<int>& of(int kind) const { return lists_[kind]; }

 private:
  void group(const int* begin, const int* end, const ContactPairs& pairs,
             const std::vector<Kind>& kind, std::vector<std::uint64_t>& used);

  std::vector<int> lists_[kKinds];
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
