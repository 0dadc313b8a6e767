# SUNDIALS with vectors over MPI ranks, for examples and tests. SPDX-License-Identifier: BSD-3-Clause
#
#   tether_find_parallel_vectors()        tether::parallel_vectors with IDA, the projection and MPI;
#                                         no target where something is missing
#   tether_mpi_test(NAME TARGET RANKS [ARGUMENT...])
#                                         a test that runs TARGET on RANKS processes

function(tether_find_parallel_vectors)
  if(TARGET tether::parallel_vectors OR NOT TARGET tether_ida_projection OR NOT TARGET tether::sundials_ida)
    return()
  endif()
  if(NOT TARGET MPI::MPI_CXX)  # contact_mpi finds it, too
    find_package(MPI QUIET COMPONENTS CXX)
    if(TARGET MPI::MPI_CXX)
      set_target_properties(MPI::MPI_CXX PROPERTIES IMPORTED_GLOBAL TRUE)
    endif()
  endif()
  # Headers of another SUNDIALS, the distribution's beside one of the caller's, do not fit.
  get_target_property(include tether::sundials_headers INTERFACE_INCLUDE_DIRECTORIES)
  if(NOT EXISTS ${include}/nvector/nvector_parallel.h)
    return()
  endif()
  find_library(TETHER_SUNDIALS_NVECPARALLEL sundials_nvecparallel HINTS ${include}/../lib ${include}/../lib64)
  mark_as_advanced(TETHER_SUNDIALS_NVECPARALLEL)
  if(NOT TARGET MPI::MPI_CXX OR NOT TETHER_SUNDIALS_NVECPARALLEL)
    return()
  endif()
  add_library(tether::parallel_vectors INTERFACE IMPORTED GLOBAL)
  target_link_libraries(tether::parallel_vectors INTERFACE tether::ida_projection tether::sundials_ida
    ${TETHER_SUNDIALS_NVECPARALLEL} MPI::MPI_CXX)
endfunction()

function(tether_mpi_test name target ranks)
  add_test(NAME ${name} COMMAND ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} $<TARGET_FILE:${target}> ${ARGN})
  set_tests_properties(${name} PROPERTIES LABELS ida_projection PROCESSORS 2 TIMEOUT ${TETHER_TEST_TIMEOUT} ENVIRONMENT
    "OMPI_ALLOW_RUN_AS_ROOT=1;OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1;OMPI_MCA_rmaps_base_oversubscribe=1;OMPI_MCA_mpi_yield_when_idle=1")
endfunction()
