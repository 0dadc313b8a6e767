# Installs the build tree TREE: all of it into PREFIX/all, and each of COMPONENTS with those that it
# stands on into a prefix of its own. SPDX-License-Identifier: BSD-3-Clause
cmake_minimum_required(VERSION 3.23)  # a script of its own: policies
file(REMOVE_RECURSE ${PREFIX})

function(install_tree prefix)
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${TREE} --prefix ${prefix} ${ARGN}
    RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_VARIABLE text)
  if(failed)
    message(FATAL_ERROR "Installation into ${prefix} failed:\n${text}")
  endif()
endfunction()

install_tree(${PREFIX}/all)
# What a component stands on beside linalg.
set(reverse_ida ida_projection)
set(contact_io contact)
set(contact_collision contact)
set(contact_mpi contact)
set(scene ida_projection contact contact_collision)
foreach(component IN LISTS COMPONENTS)
  set(parts linalg ${${component}} ${component})
  foreach(part IN LISTS parts)
    if(part IN_LIST COMPONENTS)
      install_tree(${PREFIX}/${component} --component ${part})
    endif()
  endforeach()
  file(GLOB_RECURSE files RELATIVE ${PREFIX}/${component} ${PREFIX}/${component}/*)
  if(NOT files MATCHES "libtether_${component}[.]" OR NOT files MATCHES "tether-${component}-targets")
    message(FATAL_ERROR "Component ${component} does not bring its library: ${files}")
  endif()
  foreach(library IN LISTS COMPONENTS)
    if(NOT library IN_LIST parts AND files MATCHES "(libtether_${library}[.]|tether-${library}-targets)")
      message(FATAL_ERROR "Component ${component} brings files of ${library}: ${files}")
    endif()
  endforeach()
endforeach()
