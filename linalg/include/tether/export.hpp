// Tether: which symbols the libraries show, to whom. SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Part of the installed package only: within one build the options are the same.
#if __has_include(<tether/standard_library.hpp>)
#include <tether/standard_library.hpp>
#endif

/// The libraries are compiled with hidden visibility. The declarations between these two lines of a
/// public header are visible from outside: functions, and classes with all that belongs to them.
/// Vtables and type information are part of that, so that exceptions are caught by type on the
/// other side. TETHER_HIDDEN takes an inner class out of that. What templates of Eigen make of them
/// stays inside: cmake/TetherPrivate.cmake.
#if defined(__GNUC__)
#define TETHER_EXPORT_BEGIN _Pragma("GCC visibility push(default)")
#define TETHER_EXPORT_END _Pragma("GCC visibility pop")
#define TETHER_HIDDEN __attribute__((visibility("hidden")))
#else
#define TETHER_EXPORT_BEGIN
#define TETHER_EXPORT_END
#define TETHER_HIDDEN
#endif
