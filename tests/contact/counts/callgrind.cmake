# Functions of all scripts that count instructions. SPDX-License-Identifier: BSD-3-Clause

# need_valgrind(): without it the script ends, and CTest counts it as skipped.
macro(need_valgrind)
  if(NOT VALGRIND)
    message("skipped: valgrind is not installed (Debian valgrind)")
    return()
  endif()
endmacro()

# count(<program and arguments> TOGGLE <function> TOTAL <var> FUNCTIONS <var> OUTPUT <var>): runs a
# program under callgrind, collecting inside one function only.
function(count)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "TOGGLE;TOTAL;FUNCTIONS;OUTPUT" "COMMAND")
  string(MD5 name "${arg_COMMAND}")
  set(file ${WORK}/callgrind.${name})
  file(REMOVE ${file})
  execute_process(
    COMMAND ${VALGRIND} --tool=callgrind --callgrind-out-file=${file} --compress-strings=no
            --toggle-collect=${arg_TOGGLE} ${arg_COMMAND}
    RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE log)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${arg_COMMAND}: ended with ${code}\n${output}${log}")
  endif()
  file(STRINGS ${file} total REGEX "^(totals|summary): ")
  list(GET total 0 total)
  string(REGEX REPLACE "^[a-z]+: " "" total "${total}")
  file(STRINGS ${file} functions REGEX "^fn=")
  list(TRANSFORM functions REPLACE "^fn=(\\([0-9]+\\) ?)?" "")
  list(REMOVE_DUPLICATES functions)
  if(total LESS 1000 OR NOT functions)
    message(FATAL_ERROR "nothing was collected in ${arg_TOGGLE}: ${total} instructions")
  endif()
  file(REMOVE ${file})
  foreach(result IN ITEMS TOTAL FUNCTIONS OUTPUT)
    string(TOLOWER ${result} value)
    if(arg_${result})
      set(${arg_${result}} "${${value}}" PARENT_SCOPE)
    endif()
  endforeach()
endfunction()
