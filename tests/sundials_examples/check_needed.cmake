# The shared plugin must not link libsundials_ida or libsundials_idas: the host brings one of them.
# SPDX-License-Identifier: BSD-3-Clause
execute_process(COMMAND ${READELF} -d -W ${LIBRARY} OUTPUT_VARIABLE dynamic RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "${READELF} failed on ${LIBRARY}")
endif()
string(REGEX MATCHALL "NEEDED[^\n]*" needed "${dynamic}")
if(needed MATCHES "sundials")
  message(FATAL_ERROR "${LIBRARY} links SUNDIALS:\n${needed}")
endif()
string(REPLACE ";" "\n" needed "${needed}")
message(STATUS "${LIBRARY}:\n${needed}")
