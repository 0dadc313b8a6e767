# Libraries that single components use, as targets of the same names in the build and, installed, in
# the package config. SPDX-License-Identifier: BSD-3-Clause
#
#   tether_find_hdf5()     tether::hdf5, for contact_io
#   tether_find_mpi()      MPI::MPI_CXX, for contact_mpi
# A library that is not found has no target. Functions, because FindHDF5 changes variables of its caller.

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

function(tether_find_mpi)
  if(NOT TARGET MPI::MPI_CXX)
    find_package(MPI QUIET COMPONENTS CXX)
    if(TARGET MPI::MPI_CXX)
      set_target_properties(MPI::MPI_CXX PROPERTIES IMPORTED_GLOBAL TRUE)
    endif()
  endif()
endfunction()
