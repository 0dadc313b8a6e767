# Finds SUNDIALS >= 6.4 (Debian 12 has 6.4.1; 7.x has the same interface where the plugin needs it).
# Used by the build and, installed, by the package config. SPDX-License-Identifier: BSD-3-Clause
#
#   tether::sundials_headers   the include directories only. libsundials_ida and libsundials_idas
#                              export the same symbols for different memory layouts, so the plugin
#                              links neither: its host brings the one that it uses.
#   tether::sundials_ida       IDA with serial vectors, dense, band and Krylov solvers (for hosts)
#   tether::sundials_idas      the same with sensitivities
#   tether::sundials_klu       the KLU linear solver, when SUNDIALS has it
#
# Sets TetherSundials_FOUND and, from sundials_config.h, TetherSundials_VERSION,
# TetherSundials_PRECISION (single, double, extended), TetherSundials_INDEX_BITS (32, 64) and
# TetherSundials_BUILD, the three in words; when it is missing or of no use, says what to install.
# TetherSundials_REQUIRED_BUILD (list of the three, from the package config): only a SUNDIALS that a
# library compiled with that one can run with: same major version, no earlier minor one, same
# precision and size of indices.
#
# No version is given to find_package: its version file refuses every other major version.
find_package(SUNDIALS QUIET CONFIG)
set(TetherSundials_FOUND FALSE)
set(TetherSundials_VERSION "")
set(_tether_sundials_include "")

if(SUNDIALS_FOUND AND TARGET SUNDIALS::ida)
  # SUNDIALS::core in 7.x, SUNDIALS::generic in 6.x, behind aliases that are interface targets.
  foreach(_target IN ITEMS core_shared core_static generic_shared generic_static ida_shared ida_static)
    if(TARGET SUNDIALS::${_target})
      get_target_property(_tether_sundials_include SUNDIALS::${_target} INTERFACE_INCLUDE_DIRECTORIES)
      if(_tether_sundials_include)
        break()
      endif()
    endif()
  endforeach()
  foreach(_solver IN ITEMS ida idas)
    set(_tether_link_${_solver} SUNDIALS::${_solver})
    # 7.x: the core is a library of its own.
    if(TARGET SUNDIALS::core)
      list(APPEND _tether_link_${_solver} SUNDIALS::core)
    endif()
  endforeach()
  set(_tether_link_klu "")
  if(TARGET SUNDIALS::sunlinsolklu)
    set(_tether_link_klu SUNDIALS::sunlinsolklu)
    if(TARGET SUNDIALS::KLU)
      list(APPEND _tether_link_klu SUNDIALS::KLU)
    endif()
  endif()
else()
  # An installation without a (usable) package config: the files themselves.
  find_path(TETHER_SUNDIALS_INCLUDE_DIR ida/ida.h HINTS ${SUNDIALS_DIR} ${SUNDIALS_ROOT} ENV SUNDIALS_ROOT
    PATH_SUFFIXES include DOC "Directory that holds ida/ida.h")
  find_library(TETHER_SUNDIALS_IDA_LIBRARY sundials_ida HINTS ${SUNDIALS_DIR} ${SUNDIALS_ROOT} ENV SUNDIALS_ROOT
    PATH_SUFFIXES lib lib64 DOC "libsundials_ida, for the tests and examples")
  # The others beside it: those of another SUNDIALS do not fit.
  get_filename_component(_tether_sundials_lib "${TETHER_SUNDIALS_IDA_LIBRARY}" DIRECTORY)
  find_library(TETHER_SUNDIALS_IDAS_LIBRARY sundials_idas PATHS ${_tether_sundials_lib} NO_DEFAULT_PATH)
  find_library(TETHER_SUNDIALS_CORE_LIBRARY sundials_core PATHS ${_tether_sundials_lib} NO_DEFAULT_PATH)
  find_library(TETHER_SUNDIALS_KLU_LIBRARY sundials_sunlinsolklu PATHS ${_tether_sundials_lib} NO_DEFAULT_PATH)
  mark_as_advanced(TETHER_SUNDIALS_INCLUDE_DIR TETHER_SUNDIALS_IDA_LIBRARY TETHER_SUNDIALS_IDAS_LIBRARY
    TETHER_SUNDIALS_CORE_LIBRARY TETHER_SUNDIALS_KLU_LIBRARY)
  if(TETHER_SUNDIALS_INCLUDE_DIR)
    set(_tether_sundials_include ${TETHER_SUNDIALS_INCLUDE_DIR})
    foreach(_solver IN ITEMS ida idas klu)
      string(TOUPPER ${_solver} _upper)
      set(_tether_link_${_solver} "")
      if(TETHER_SUNDIALS_${_upper}_LIBRARY)
        set(_tether_link_${_solver} ${TETHER_SUNDIALS_${_upper}_LIBRARY})
        if(TETHER_SUNDIALS_CORE_LIBRARY)
          list(APPEND _tether_link_${_solver} ${TETHER_SUNDIALS_CORE_LIBRARY})
        endif()
      endif()
    endforeach()
    if(_tether_link_klu)
      find_path(TETHER_KLU_INCLUDE_DIR klu.h PATH_SUFFIXES suitesparse)
      find_library(TETHER_KLU_LIBRARY klu)
      mark_as_advanced(TETHER_KLU_INCLUDE_DIR TETHER_KLU_LIBRARY)
      list(APPEND _tether_link_klu ${TETHER_KLU_LIBRARY})
    endif()
  endif()
endif()

# Settings that programs will be compiled with.
set(TetherSundials_PRECISION "")
set(TetherSundials_INDEX_BITS "")
foreach(_directory IN LISTS _tether_sundials_include)
  if(EXISTS "${_directory}/sundials/sundials_config.h" AND NOT TetherSundials_VERSION)
    file(STRINGS "${_directory}/sundials/sundials_config.h" _tether_sundials_lines REGEX "^#define SUNDIALS_")
    if(_tether_sundials_lines MATCHES "SUNDIALS_VERSION \"([0-9]+\\.[0-9]+\\.[0-9]+)")
      set(TetherSundials_VERSION ${CMAKE_MATCH_1})
    endif()
    if(_tether_sundials_lines MATCHES "SUNDIALS_(SINGLE|DOUBLE|EXTENDED)_PRECISION")
      string(TOLOWER ${CMAKE_MATCH_1} TetherSundials_PRECISION)
    endif()
    if(_tether_sundials_lines MATCHES "SUNDIALS_INT(32|64)_T")
      set(TetherSundials_INDEX_BITS ${CMAKE_MATCH_1})
    endif()
  endif()
endforeach()
set(TetherSundials_BUILD
  "${TetherSundials_VERSION} (${TetherSundials_PRECISION} precision, ${TetherSundials_INDEX_BITS}-bit indices)")

set(_tether_sundials_problem "")
if(NOT TetherSundials_VERSION)
  set(_tether_sundials_problem
    "SUNDIALS (6.4 or newer) not found. Install libsundials-dev, or set CMAKE_PREFIX_PATH to its prefix.")
elseif(TetherSundials_VERSION VERSION_LESS 6.4)
  set(_tether_sundials_problem "SUNDIALS ${TetherSundials_VERSION} is too old: 6.4 or newer is needed.")
elseif(NOT TetherSundials_PRECISION STREQUAL "double")
  set(_tether_sundials_problem "SUNDIALS ${TetherSundials_BUILD} in ${_tether_sundials_include} is of no use:\
 Tether needs double precision (SUNDIALS_PRECISION=double).")
elseif(TetherSundials_REQUIRED_BUILD)
  list(GET TetherSundials_REQUIRED_BUILD 0 _tether_version)
  list(GET TetherSundials_REQUIRED_BUILD 1 _tether_precision)
  list(GET TetherSundials_REQUIRED_BUILD 2 _tether_bits)
  string(REGEX REPLACE "^([0-9]+)\\.([0-9]+).*" "\\1.\\2" _tether_least ${_tether_version})
  string(REGEX REPLACE "\\..*" "" _tether_major ${_tether_version})
  math(EXPR _tether_next "${_tether_major} + 1")
  if(TetherSundials_VERSION VERSION_LESS _tether_least OR NOT TetherSundials_VERSION VERSION_LESS _tether_next
     OR NOT TetherSundials_INDEX_BITS STREQUAL _tether_bits OR NOT TetherSundials_PRECISION STREQUAL _tether_precision)
    set(_tether_sundials_problem "this Tether was built for SUNDIALS ${_tether_version} (${_tether_precision}\
 precision, ${_tether_bits}-bit indices), but SUNDIALS ${TetherSundials_BUILD} was found in\
 ${_tether_sundials_include}. Set SUNDIALS_DIR to the one it was built for (${_tether_least} or a later\
 ${_tether_major}.x), or build Tether with this one.")
  endif()
endif()

if(_tether_sundials_problem STREQUAL "")
  set(TetherSundials_FOUND TRUE)
  if(NOT TARGET tether::sundials_headers)
    add_library(tether::sundials_headers INTERFACE IMPORTED GLOBAL)
    target_include_directories(tether::sundials_headers SYSTEM INTERFACE ${_tether_sundials_include})
  endif()
  foreach(_solver IN ITEMS ida idas klu)
    if(_tether_link_${_solver} AND NOT TARGET tether::sundials_${_solver})
      add_library(tether::sundials_${_solver} INTERFACE IMPORTED)
      target_link_libraries(tether::sundials_${_solver} INTERFACE
        ${_tether_link_${_solver}} tether::sundials_headers)
      if(_solver STREQUAL "klu" AND TETHER_KLU_INCLUDE_DIR)
        target_include_directories(tether::sundials_klu SYSTEM INTERFACE ${TETHER_KLU_INCLUDE_DIR})
      endif()
    endif()
  endforeach()
  if(NOT CMAKE_FIND_PACKAGE_NAME)
    message(STATUS "SUNDIALS ${TetherSundials_BUILD}: ${_tether_sundials_include}")
  endif()
else()
  set(TetherSundials_NOT_FOUND_MESSAGE "${_tether_sundials_problem}")
  if(NOT CMAKE_FIND_PACKAGE_NAME)  # not inside tether-config.cmake
    message(FATAL_ERROR "${TetherSundials_NOT_FOUND_MESSAGE} Or build without the plugin: "
      "-DTETHER_BUILD_IDA_PROJECTION=OFF")
  endif()
endif()
