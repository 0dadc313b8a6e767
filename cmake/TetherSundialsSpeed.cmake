# Warns of a SUNDIALS that was built without optimisation: Debian's is, and one built by its own CMake
# without a build type. Its vectors and its dense solver then are several times slower.
# SPDX-License-Identifier: BSD-3-Clause
#
# Sets TETHER_SUNDIALS_OPTIMISED in the cache: ON, OFF, or nothing where it cannot be found out (cross
# compiling, no serial vectors). Delete it to ask again; set it to ON to hear no more of it.
#
# The same loop, z = a x + b y, is timed in SUNDIALS and in a program compiled for this purpose, in
# turns of a microsecond or two, of which the fastest counts: that is one which nothing else on the
# machine has interrupted. The ratio is 0.5 to 1.3 for optimised libraries and beyond 4 without; it
# does not depend on the processor's speed or load.
function(_tether_measure_sundials)
  set(TETHER_SUNDIALS_OPTIMISED "" CACHE STRING "Is the SUNDIALS that was found optimised? (empty: unknown)")
  mark_as_advanced(TETHER_SUNDIALS_OPTIMISED)
  if(CMAKE_CROSSCOMPILING OR TETHER_SANITIZERS OR NOT TARGET tether::sundials_ida
     OR NOT CMAKE_C_COMPILER_ID MATCHES "GNU|Clang")
    return()
  endif()
  # Another library is measured again; what the user says stands for the one that he has.
  get_target_property(libraries tether::sundials_ida INTERFACE_LINK_LIBRARIES)
  set(measured "${TetherSundials_VERSION};${_tether_sundials_include};${libraries}")
  set(before "${TETHER_SUNDIALS_MEASURED}")
  set(TETHER_SUNDIALS_MEASURED "${measured}" CACHE INTERNAL "What TETHER_SUNDIALS_OPTIMISED is about")
  if(before STREQUAL measured OR (before STREQUAL "" AND NOT TETHER_SUNDIALS_OPTIMISED STREQUAL ""))
    return()
  endif()
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/tether_sundials_speed)
  unset(TETHER_SUNDIALS_SPEED_RUN CACHE)
  try_run(TETHER_SUNDIALS_SPEED_RUN compiled ${folder} ${CMAKE_CURRENT_FUNCTION_LIST_DIR}/sundials_speed.c
    COMPILE_DEFINITIONS -O2 -fno-tree-vectorize  # known to GCC and Clang
    LINK_LIBRARIES tether::sundials_ida
    RUN_OUTPUT_VARIABLE ratio)
  unset(TETHER_SUNDIALS_SPEED_RUN CACHE)
  set(optimised "")
  if(compiled AND ratio MATCHES "^ratio ([0-9.]+)")
    set(optimised ON)
    if(CMAKE_MATCH_1 GREATER 2.2)
      set(optimised OFF)
    endif()
  endif()
  set(TETHER_SUNDIALS_OPTIMISED "${optimised}" CACHE STRING
    "Is the SUNDIALS that was found optimised? (empty: unknown)" FORCE)
endfunction()

_tether_measure_sundials()
if(DEFINED TETHER_SUNDIALS_OPTIMISED AND NOT TETHER_SUNDIALS_OPTIMISED STREQUAL ""
   AND NOT TETHER_SUNDIALS_OPTIMISED)
  message(WARNING "SUNDIALS ${TetherSundials_VERSION} was built without optimisation: IDA's own work takes "
    "longer than it could. Results are the same. For speed build it with\n"
    "  sh benchmarks/optimised_sundials.sh build/sundials\n"
    "(or from its source with -DCMAKE_BUILD_TYPE=Release) and configure with "
    "-DCMAKE_PREFIX_PATH=<that folder>. fast_vector() and fast_dense_solver() make up for most of it. "
    "TETHER_SUNDIALS_OPTIMISED=ON silences this.")
endif()
