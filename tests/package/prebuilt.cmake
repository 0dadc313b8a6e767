# The libraries of a project that contains Tether, from the objects that Tether's own build has made:
# they are position-independent and hide what is not exported, for either kind of library. The
# package tests that compile Tether as a part of their project do without.
# SPDX-License-Identifier: BSD-3-Clause
#
# TETHER_OBJECTS_<library>: the object files, separated by "|". TETHER_OBJECTS_program: those of the
# program, where that is built.
function(tether_take_objects)
  get_property(libraries GLOBAL PROPERTY TETHER_LIBRARIES)
  foreach(library IN LISTS libraries)
    string(REPLACE "|" ";" objects "${TETHER_OBJECTS_${library}}")
    if(NOT objects)
      message(FATAL_ERROR "No objects of ${library} were given")
    endif()
    set_source_files_properties(${objects} TARGET_DIRECTORY tether_${library} PROPERTIES EXTERNAL_OBJECT TRUE)
    set_target_properties(tether_${library} PROPERTIES SOURCES "${objects}" LINKER_LANGUAGE CXX)
  endforeach()
  if(TARGET tether_program AND TETHER_OBJECTS_program)
    string(REPLACE "|" ";" objects "${TETHER_OBJECTS_program}")
    set_source_files_properties(${objects} TARGET_DIRECTORY tether_program PROPERTIES EXTERNAL_OBJECT TRUE)
    set_target_properties(tether_program PROPERTIES SOURCES "${objects}" LINKER_LANGUAGE CXX)
  endif()
endfunction()
cmake_language(DEFER CALL tether_take_objects)
