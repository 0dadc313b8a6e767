// Tether: a SUNDIALS context that keeps its errors. SPDX-License-Identifier: BSD-3-Clause
#include "quiet_context.hpp"

#include <ida/ida.h>
#include <new>

namespace tether::scene {

namespace {

#ifdef SUN_COMM_NULL  // SUNDIALS 7
void remember(int, const char*, const char*, const char* message, SUNErrCode, void* data,
              SUNContext) {
  *static_cast<std::string*>(data) = message ? message : "";
}
#else
void remember(int, const char*, const char*, char* message, void* data) {
  *static_cast<std::string*>(data) = message ? message : "";
}
#endif

}  // namespace

QuietContext::QuietContext() {
#ifdef SUN_COMM_NULL
  SUNContext_Create(SUN_COMM_NULL, &context_);
#else
  SUNContext_Create(nullptr, &context_);
#endif
  if (context_ == nullptr) throw std::bad_alloc();
#ifdef SUN_COMM_NULL
  SUNContext_ClearErrHandlers(context_);
#endif
}

QuietContext::~QuietContext() { SUNContext_Free(&context_); }

void QuietContext::keep_messages_of(void* ida) {
#ifdef SUN_COMM_NULL
  static_cast<void>(ida);
  SUNContext_PushErrHandler(context_, remember, &message_);
#else
  IDASetErrHandlerFn(ida, remember, &message_);
#endif
}

}  // namespace tether::scene
