// Tether: a SUNDIALS context that keeps its errors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <sundials/sundials_context.h>

namespace tether::scene {

class QuietContext {
 public:
  QuietContext();
  ~QuietContext();
  QuietContext(const QuietContext&) = delete;
  QuietContext& operator=(const QuietContext&) = delete;
  operator SUNContext() const { return context_; }

  /// Errors of `ida`, which IDACreate has made in this context, go to message().
  void keep_messages_of(void* ida);
  /// The last error; its owner may clear or replace it.
  std::string& message() { return message_; }
  const std::string& message() const { return message_; }

 private:
  SUNContext context_ = nullptr;
  std::string message_;
};

}  // namespace tether::scene
