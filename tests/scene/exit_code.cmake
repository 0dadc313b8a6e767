# Runs PROGRAM on SCENE and wants it to exit with CODE. SPDX-License-Identifier: BSD-3-Clause
execute_process(COMMAND ${PROGRAM} run ${SCENE} --quiet RESULT_VARIABLE code)
if(NOT code STREQUAL CODE)
  message(FATAL_ERROR "exit code ${code}, expected ${CODE}")
endif()
