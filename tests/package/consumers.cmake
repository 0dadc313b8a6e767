# The programs of a consumer: one for each Tether library that the including project brought or, with
# TETHER_COMPONENTS, asked for. SPDX-License-Identifier: BSD-3-Clause
enable_testing()

function(wanted library result)
  set(${result} FALSE PARENT_SCOPE)
  if(TARGET tether::${library} AND (NOT TETHER_COMPONENTS OR library IN_LIST TETHER_COMPONENTS))
    set(${result} TRUE PARENT_SCOPE)
  endif()
endfunction()

foreach(library IN ITEMS linalg contact contact_io contact_collision contact_mpi scene)
  wanted(${library} wanted)
  if(wanted)
    add_executable(use_${library} ${CMAKE_CURRENT_LIST_DIR}/${library}.cpp)
    target_link_libraries(use_${library} PRIVATE tether::${library})
    add_test(NAME ${library} COMMAND use_${library})
  endif()
endforeach()

if(TARGET tether::ida_projection)
  # The host brings its own SUNDIALS: here once IDA, once IDAS.
  find_package(SUNDIALS)
endif()
wanted(ida_projection wanted)
if(wanted)
  add_library(pendulum OBJECT ${CMAKE_CURRENT_LIST_DIR}/pendulum.cpp)
  target_link_libraries(pendulum PRIVATE tether::ida_projection)
  foreach(solver IN ITEMS ida idas)
    add_executable(pendulum_${solver} $<TARGET_OBJECTS:pendulum>)
    target_link_libraries(pendulum_${solver} PRIVATE tether::ida_projection
      $<IF:$<BOOL:${SUNDIALS_FOUND}>,SUNDIALS::${solver},sundials_${solver}>)
    set_target_properties(pendulum_${solver} PROPERTIES LINKER_LANGUAGE CXX)
    add_test(NAME pendulum_${solver} COMMAND pendulum_${solver})
  endforeach()
  # A program in C; libraries that were compiled before do not tell CMake that they are C++.
  add_executable(pendulum_in_c ${CMAKE_CURRENT_LIST_DIR}/../../examples/drop_in/in_c.c)
  target_link_libraries(pendulum_in_c PRIVATE tether::ida_projection
    $<IF:$<BOOL:${SUNDIALS_FOUND}>,SUNDIALS::ida,sundials_ida> m)
  set_target_properties(pendulum_in_c PROPERTIES LINKER_LANGUAGE CXX)
  add_test(NAME pendulum_in_c COMMAND pendulum_in_c)
endif()
wanted(reverse_ida wanted)
if(wanted)
  add_executable(use_reverse_ida ${CMAKE_CURRENT_LIST_DIR}/reverse_ida.cpp)
  target_link_libraries(use_reverse_ida PRIVATE tether::reverse_ida
    $<IF:$<BOOL:${SUNDIALS_FOUND}>,SUNDIALS::ida,sundials_ida>)
  add_test(NAME reverse_ida COMMAND use_reverse_ida)
endif()
