// Tether: a function on a stack of its own, which can be left and entered again.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <boost/context/fiber.hpp>
#include <boost/context/protected_fixedsize_stack.hpp>
#include <cstddef>
#include <memory>
#include <utility>

namespace tether::reverse_ida {

/// `body` must not throw and has to return before the Fiber is destroyed, if it was ever entered:
/// unwinding its stack by an exception, as Boost would, is not for frames of C.
class Fiber {
 public:
  template <class Body>
  Fiber(std::size_t stack, Body body)
      : inside_(std::allocator_arg, boost::context::protected_fixedsize_stack(stack),
                [this, body = std::move(body)](boost::context::fiber&& caller) mutable {
                  outside_ = std::move(caller);
                  body();
                  return std::move(outside_);
                }) {}
  Fiber(const Fiber&) = delete;
  Fiber& operator=(const Fiber&) = delete;

  /// Runs the body until it leaves or ends.
  void enter() { inside_ = std::move(inside_).resume(); }
  /// Called by the body: goes back to where it was entered.
  void leave() { outside_ = std::move(outside_).resume(); }
  bool ended() const { return !inside_; }

 private:
  boost::context::fiber inside_, outside_;
};

}  // namespace tether::reverse_ida
