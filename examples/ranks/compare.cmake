# Runs PROGRAM on several numbers of ranks: what it says of the motion has to be the same, bit by bit.
# SPDX-License-Identifier: BSD-3-Clause
set(ENV{OMPI_ALLOW_RUN_AS_ROOT} 1)
set(ENV{OMPI_ALLOW_RUN_AS_ROOT_CONFIRM} 1)
set(ENV{OMPI_MCA_rmaps_base_oversubscribe} 1)  # more ranks than processors
set(ENV{OMPI_MCA_mpi_yield_when_idle} 1)
foreach(ranks IN ITEMS 1 2 5)
  execute_process(COMMAND ${MPIEXEC} ${NUMPROC} ${ranks} ${PROGRAM} --spheres 1000 --steps 60
    OUTPUT_VARIABLE text COMMAND_ERROR_IS_FATAL ANY)
  message("${ranks} ranks:\n${text}")
  string(REGEX MATCH "state after[^\n]*" state "${text}")
  if(NOT state OR (DEFINED first AND NOT state STREQUAL first))
    message(FATAL_ERROR "another motion than on one rank")
  endif()
  set(first "${state}")
endforeach()
