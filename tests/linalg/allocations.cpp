// Tether: counts memory allocations of the whole process, and lets one fail.
// SPDX-License-Identifier: BSD-3-Clause
#include "allocations.hpp"

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <new>

namespace {
std::atomic<long> count{0}, alive{0}, failing{-1};

// False: this one is to fail.
bool granted() {
  ++count;
  return failing.load() < 0 || failing.fetch_sub(1) != 0;
}
void* noted(void* p) {
  if (p != nullptr) ++alive;
  return p;
}
void released(const void* p) {
  if (p != nullptr) --alive;
}
}  // namespace

namespace tether::test {
long allocations() { return count.load(); }
long blocks_alive() { return alive.load(); }
void fail_allocation(long n) { failing = n; }
bool allocation_failed() { return failing.load() < 0; }
}  // namespace tether::test

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TETHER_TEST_OPERATOR_NEW
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TETHER_TEST_OPERATOR_NEW
#endif
#endif
#if !defined(__GLIBC__) && !defined(TETHER_TEST_OPERATOR_NEW)
#define TETHER_TEST_OPERATOR_NEW
#endif

#ifdef TETHER_TEST_OPERATOR_NEW

void* operator new(std::size_t size) {
  if (void* p = granted() ? noted(std::malloc(size)) : nullptr) return p;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {  // std::stable_sort
  return granted() ? noted(std::malloc(size)) : nullptr;
}
void operator delete(void* p) noexcept {
  released(p);
  std::free(p);
}
void operator delete(void* p, const std::nothrow_t&) noexcept { operator delete(p); }
void operator delete(void* p, std::size_t) noexcept { operator delete(p); }

#else

// Definitions in the program take the place of glibc's, also for the shared libraries it loads.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) noexcept { return granted() ? noted(__libc_malloc(size)) : nullptr; }
void* calloc(std::size_t n, std::size_t size) noexcept {
  return granted() ? noted(__libc_calloc(n, size)) : nullptr;
}
void* realloc(void* p, std::size_t size) noexcept {
  if (!granted()) return nullptr;
  void* moved = __libc_realloc(p, size);
  if (p == nullptr) noted(moved);
  if (p != nullptr && size == 0 && moved == nullptr) released(p);
  return moved;
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  return granted() ? noted(__libc_memalign(alignment, size)) : nullptr;
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) noexcept {
  void* made = granted() ? noted(__libc_memalign(alignment, size)) : nullptr;
  if (made == nullptr) return ENOMEM;
  *p = made;
  return 0;
}
void free(void* p) noexcept {
  released(p);
  __libc_free(p);
}
}

#endif
