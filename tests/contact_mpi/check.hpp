// Tether: checks of programs that run on several ranks. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <mpi.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

// A rank that fails ends all: the others may wait for it.
#define CHECK(condition)                                            \
  do {                                                              \
    if (!(condition)) check_failed(__FILE__, __LINE__, #condition); \
  } while (false)

[[noreturn]] inline void check_failed(const char* file, int line, const char* what) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  std::fprintf(stderr, "%s:%d: rank %d: failed: %s\n", file, line, rank, what);
  MPI_Abort(MPI_COMM_WORLD, 1);
  std::abort();
}

// Text of the error that `work` throws; fails if it throws nothing.
template <class Error, class Work>
std::string thrown(const Work& work) {
  try {
    work();
  } catch (const Error& e) {
    return e.what();
  } catch (const std::exception& e) {
    return std::string("another exception: ") + e.what();
  }
  return "nothing was thrown";
}

inline bool contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return true;
  std::fprintf(stderr, "\"%s\" has no \"%s\"\n", text.c_str(), part.c_str());
  return false;
}
