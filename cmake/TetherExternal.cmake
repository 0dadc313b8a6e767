# Libraries that single components use, as targets of the same names in the build and, installed, in
# the package config. SPDX-License-Identifier: BSD-3-Clause
#
#   tether_find_hdf5()     tether::hdf5, for contact_io
#   tether_find_zoltan()   MPI::MPI_CXX and tether::zoltan, for contact_mpi; TETHER_ZOLTAN_MISSING
#                          says what is not there
# Where one is not found, there is no target. Functions, because FindHDF5 changes variables of its caller.

function(tether_find_hdf5)
  if(NOT TARGET tether::hdf5)
    find_package(HDF5 QUIET COMPONENTS C)
    if(HDF5_FOUND)
      add_library(tether::hdf5 INTERFACE IMPORTED GLOBAL)
      target_include_directories(tether::hdf5 SYSTEM INTERFACE ${HDF5_C_INCLUDE_DIRS})
      target_link_libraries(tether::hdf5 INTERFACE ${HDF5_C_LIBRARIES})
      target_compile_definitions(tether::hdf5 INTERFACE ${HDF5_C_DEFINITIONS})
    endif()
  endif()
endfunction()

macro(tether_find_zoltan)
  set(TETHER_ZOLTAN_MISSING "")
  if(NOT TARGET MPI::MPI_CXX)
    find_package(MPI QUIET COMPONENTS CXX)
    if(TARGET MPI::MPI_CXX)
      set_target_properties(MPI::MPI_CXX PROPERTIES IMPORTED_GLOBAL TRUE)
    endif()
  endif()
  if(NOT TARGET MPI::MPI_CXX)
    set(TETHER_ZOLTAN_MISSING "MPI not found (install libopenmpi-dev; C++ must be enabled)")
  elseif(NOT TARGET tether::zoltan)
    find_path(TETHER_ZOLTAN_INCLUDE_DIR zoltan.h PATH_SUFFIXES trilinos)
    find_library(TETHER_ZOLTAN NAMES trilinos_zoltan zoltan)
    mark_as_advanced(TETHER_ZOLTAN_INCLUDE_DIR TETHER_ZOLTAN)
    if(TETHER_ZOLTAN_INCLUDE_DIR AND TETHER_ZOLTAN)
      add_library(tether::zoltan INTERFACE IMPORTED GLOBAL)
      target_include_directories(tether::zoltan SYSTEM INTERFACE ${TETHER_ZOLTAN_INCLUDE_DIR})
      target_link_libraries(tether::zoltan INTERFACE ${TETHER_ZOLTAN} MPI::MPI_CXX)
    else()
      set(TETHER_ZOLTAN_MISSING "Zoltan not found (install libtrilinos-zoltan-dev)")
    endif()
  endif()
endmacro()
