# Keeps what templates and inline functions made in a static library inside it.
# SPDX-License-Identifier: BSD-3-Clause
#
# Two objects that both hold, say, Eigen::VectorXd::resize() as a weak symbol share one of them after
# linking. Eigen's code differs with the compiler's flags under the same name (-mavx changes how
# memory is allocated), so that a program compiled with other flags than the library would call a
# mixture. A shared library has hidden visibility for that; in an archive, hidden symbols still merge
# with the program's. Here each object of an archive is given its own: COMDAT groups are resolved
# (ld -r --force-group-allocation) and weak symbols made local (objcopy). Objects stay apart, so that
# a program still links only those that it needs.
#
#   tether_keep_private(<target>)   for a static library; elsewhere nothing is done
#
# As a script: cmake -DARCHIVE= -DWORK= -DOBJECTS=<list> -DAR= -DLD= -DNM= -DOBJCOPY= -P <this file>
if(NOT CMAKE_SCRIPT_MODE_FILE)
  set(TETHER_PRIVATE_SCRIPT ${CMAKE_CURRENT_LIST_FILE})
  if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang" AND CMAKE_OBJCOPY)
    find_program(TETHER_LD NAMES ${CMAKE_CXX_COMPILER_TARGET}-ld.bfd ld.bfd ld)
    mark_as_advanced(TETHER_LD)
    if(TETHER_LD)
      execute_process(COMMAND ${TETHER_LD} --help OUTPUT_VARIABLE TETHER_LD_HELP ERROR_QUIET)
    endif()
  endif()

  function(tether_keep_private target)
    get_target_property(type ${target} TYPE)
    if(NOT type STREQUAL "STATIC_LIBRARY" OR TETHER_SANITIZERS OR TETHER_COVERAGE)
      return()
    endif()
    if(NOT TETHER_LD_HELP MATCHES "--force-group-allocation")
      get_property(said GLOBAL PROPERTY TETHER_PRIVATE_SAID)
      if(NOT said)
        message(STATUS "Static libraries share Eigen's symbols with programs (needs GNU ld and objcopy): "
          "compile both with the same flags, or set BUILD_SHARED_LIBS")
        set_property(GLOBAL PROPERTY TETHER_PRIVATE_SAID TRUE)
      endif()
      return()
    endif()
    # objcopy cannot make unique symbols local; as weak ones they do the same within a program.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
    add_custom_command(TARGET ${target} POST_BUILD VERBATIM COMMAND ${CMAKE_COMMAND}
      -DARCHIVE=$<TARGET_FILE:${target}> -DWORK=${CMAKE_CURRENT_BINARY_DIR}/${target}.private
      # Objects may also be among the sources (the tests of the package reuse those of the build).
      "-DOBJECTS=$<TARGET_OBJECTS:${target}>;$<FILTER:$<TARGET_PROPERTY:${target},SOURCES>,INCLUDE,[.]o$>"
      -DROOT=${CMAKE_CURRENT_BINARY_DIR}
      -DAR=${CMAKE_AR} -DLD=${TETHER_LD} -DNM=${CMAKE_NM} -DOBJCOPY=${CMAKE_OBJCOPY}
      -P ${TETHER_PRIVATE_SCRIPT})
  endfunction()
  return()
endif()

cmake_minimum_required(VERSION 3.23)  # a script of its own: policies

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

list(FILTER OBJECTS INCLUDE REGEX "[.]o$")  # precompiled headers are listed, too
file(RENAME ${ARCHIVE} ${ARCHIVE}.whole)  # a failure below leaves none, and is not passed over later

# Symbols that one object takes from another stay visible (and hidden from outside): explicit instantiations
# of templates are weak, too.
execute_process(COMMAND ${NM} --undefined-only --format=posix ${OBJECTS}
  OUTPUT_VARIABLE shared COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[^\n ]+ U" shared "${shared}")
list(TRANSFORM shared REPLACE " U" "")
list(REMOVE_DUPLICATES shared)

set(private)
foreach(object IN LISTS OBJECTS)
  file(RELATIVE_PATH name ${ROOT} ${object})
  string(MAKE_C_IDENTIFIER ${name} name)
  set(out ${WORK}/${name}.o)
  list(APPEND private ${out})
  execute_process(COMMAND ${NM} --defined-only --format=posix ${object}
    OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
  if(symbols MATCHES "__gnu_lto")
    file(RENAME ${ARCHIVE}.whole ${ARCHIVE})
    return()  # not machine code yet: link-time optimisation sees programs and libraries as one
  endif()
  # Weak functions (W) and weak data (V), defined here.
  string(REGEX MATCHALL "[^\n ]+ [WV] " weak "${symbols}")
  list(TRANSFORM weak REPLACE " .*" "")
  if(weak AND shared)
    list(REMOVE_ITEM weak ${shared})
  endif()
  string(JOIN "\n" weak ${weak} "")
  set(before "")
  if(EXISTS ${WORK}/${name}.weak)
    file(READ ${WORK}/${name}.weak before)
  endif()
  if(EXISTS ${out} AND weak STREQUAL before AND NOT ${object} IS_NEWER_THAN ${out})
    continue()
  endif()
  file(WRITE ${WORK}/${name}.weak "${weak}")
  run(${LD} -r --force-group-allocation -o ${out}.new ${object})
  if(weak)  # objcopy fails on an empty list
    run(${OBJCOPY} --localize-symbols=${WORK}/${name}.weak ${out}.new)
  endif()
  file(RENAME ${out}.new ${out})
endforeach()
file(REMOVE ${ARCHIVE}.whole)
string(JOIN "\n" list ${private})
file(WRITE ${WORK}/objects "${list}\n")
run(${AR} qcs ${ARCHIVE} @${WORK}/objects)
