# Configures SOURCE in BUILD with ARGUMENTS, builds it and runs its tests.
# FAILS_WITH: the configuration has to stop with this message instead.
# SPDX-License-Identifier: BSD-3-Clause
file(REMOVE_RECURSE ${BUILD})

execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE} -B ${BUILD} ${ARGUMENTS}
  RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_VARIABLE text)
if(FAILS_WITH)
  string(REGEX REPLACE "[ \n]+" " " text "${text}")
  if(NOT failed OR NOT text MATCHES "${FAILS_WITH}")
    message("${text}")
    message(FATAL_ERROR "Expected a stop with '${FAILS_WITH}'")
  endif()
  return()
endif()
if(failed)
  message("${text}")
  message(FATAL_ERROR "Configuration failed")
endif()

foreach(command IN ITEMS "--build;${BUILD}" "-E;chdir;${BUILD};${CMAKE_CTEST_COMMAND};--output-on-failure")
  execute_process(COMMAND ${CMAKE_COMMAND} ${command}
    RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_VARIABLE text)
  if(failed)
    message("${text}")
    message(FATAL_ERROR "cmake ${command}: failed")
  endif()
endforeach()
message("${text}")
