// Tether: other processes that sweep the same islands. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "body_passes/moving_bodies.hpp"
#include "graph/contact_graph.hpp"

namespace tether::contact::detail {

struct PassResult;

// Exchange between processes that share islands. Called by the first thread of each, in the same
// order.
class SweepPartners {
 public:
  virtual ~SweepPartners() = default;

  // Islands have the same numbers here and in the whole graph.
  virtual bool here(int island) const = 0;    // some contact of it
  virtual bool shared(int island) const = 0;  // several processes sweep it
  virtual const ContactGraph& whole() const = 0;
  virtual bool reports(int island) const = 0;  // this process, and no other
  // The calls below are about this island.
  virtual void begin(int island) = 0;

  // Velocities that the chunks of a colour have changed, to who sweeps these bodies next.
  virtual void after_colour(int colour, MovingBodies& bodies) = 0;
  // Velocities as they are after a sweep, to all that have the body.
  virtual void share(MovingBodies& bodies) = 0;
  // The sums of all processes; sums: of each chunk of this process.
  virtual PassResult total(const std::vector<PassResult>& sums) = 0;

  // After all islands: those to be assembled are brought together and solved. failed: this process
  // is about to throw.
  virtual void finish(bool failed) = 0;
  // The others wait for this process, which cannot go on: ends all of them.
  virtual void give_up(const char* why) = 0;
};

}  // namespace tether::contact::detail
