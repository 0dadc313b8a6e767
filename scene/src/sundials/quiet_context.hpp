// Tether: a SUNDIALS context that keeps its errors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ida/ida.h>
#include <sundials/sundials_context.h>

#include <new>
#include <string>

namespace tether::scene {

class QuietContext {
 public:
  QuietContext() {
#ifdef SUN_COMM_NULL  // SUNDIALS 7
    SUNContext_Create(SUN_COMM_NULL, &context_);
#else
    SUNContext_Create(nullptr, &context_);
#endif
    if (context_ == nullptr) throw std::bad_alloc();
#ifdef SUN_COMM_NULL
    SUNContext_ClearErrHandlers(context_);
#endif
  }
  ~QuietContext() { SUNContext_Free(&context_); }
  QuietContext(const QuietContext&) = delete;
  QuietContext& operator=(const QuietContext&) = delete;
  operator SUNContext() const { return context_; }

  /// Errors of `ida`, which IDACreate has made in this context, go to message().
  void keep_messages_of(void* ida) {
#ifdef SUN_COMM_NULL
    static_cast<void>(ida);
    SUNContext_PushErrHandler(
        context_,
        [](int, const char*, const char*, const char* message, SUNErrCode, void* data, SUNContext) {
          remember(message, data);
        },
        &message_);
#else
    IDASetErrHandlerFn(
        ida,
        [](int, const char*, const char*, char* message, void* data) { remember(message, data); },
        &message_);
#endif
  }
  /// The last error; its owner may clear or replace it.
  std::string& message() { return message_; }
  const std::string& message() const { return message_; }

 private:
  static void remember(const char* message, void* data) {
    *static_cast<std::string*>(data) = message ? message : "";
  }

  SUNContext context_ = nullptr;
  std::string message_;
};

}  // namespace tether::scene
