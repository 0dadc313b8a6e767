# The libraries of a project that contains Tether, from the objects that Tether's own build has made:
# they are position-independent and hide what is not exported, for either kind of library.
# SPDX-License-Identifier: BSD-3-Clause
#
# TETHER_OBJECTS_<library>: the object files, separated by "|". TETHER_OBJECTS_program, _import, ...: those
# of programs and modules, where they are built. TETHER_COMPILED_HERE: sources, relative to their library, that the
# project compiles itself.
function(tether_take_objects)
  get_property(libraries GLOBAL PROPERTY TETHER_LIBRARIES)
  foreach(library IN LISTS libraries)
    string(REPLACE "|" ";" objects "${TETHER_OBJECTS_${library}}")
    if(NOT objects)
      message(FATAL_ERROR "No objects of ${library} were given")
    endif()
    get_target_property(sources tether_${library} SOURCES)
    set(own "")
    string(REPLACE "|" ";" here "${TETHER_COMPILED_HERE}")
    foreach(source IN LISTS here)
      if(source IN_LIST sources)
        list(FILTER objects EXCLUDE REGEX "[.]dir/(./)?${source}[.]o$")
        list(APPEND own ${source})
      endif()
    endforeach()
    set_source_files_properties(${objects} TARGET_DIRECTORY tether_${library} PROPERTIES EXTERNAL_OBJECT TRUE)
    set_target_properties(tether_${library} PROPERTIES SOURCES "${objects};${own}" LINKER_LANGUAGE CXX)
  endforeach()
  foreach(part IN ITEMS program import mpi preload)
    if(TARGET tether_${part} AND TETHER_OBJECTS_${part})
      string(REPLACE "|" ";" objects "${TETHER_OBJECTS_${part}}")
      set_source_files_properties(${objects} TARGET_DIRECTORY tether_${part} PROPERTIES EXTERNAL_OBJECT TRUE)
      set_target_properties(tether_${part} PROPERTIES SOURCES "${objects}" LINKER_LANGUAGE CXX)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL tether_take_objects)
