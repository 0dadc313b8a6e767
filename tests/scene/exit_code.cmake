# Runs PROGRAM with ARGUMENTS (a list) and wants it to exit with CODE and, where it is given, to print
# TEXT. SPDX-License-Identifier: BSD-3-Clause
execute_process(COMMAND ${PROGRAM} ${ARGUMENTS} RESULT_VARIABLE code OUTPUT_VARIABLE said
  ERROR_VARIABLE said)
if(NOT code STREQUAL CODE)
  message(FATAL_ERROR "exit code ${code}, expected ${CODE}; it printed: ${said}")
endif()
if(TEXT)
  string(FIND "${said}" "${TEXT}" at)
  if(at EQUAL -1)
    message(FATAL_ERROR "\"${TEXT}\" is not in: ${said}")
  endif()
endif()
