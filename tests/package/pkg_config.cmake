# Builds the consumers with nothing but a compiler and pkg-config. SPDX-License-Identifier: BSD-3-Clause
file(REMOVE_RECURSE ${WORK})
file(MAKE_DIRECTORY ${WORK})
set(ENV{PKG_CONFIG_PATH} ${PREFIX}/${LIBDIR}/pkgconfig)
set(ENV{LD_LIBRARY_PATH} ${PREFIX}/${LIBDIR})

function(compile_and_run program source package)
  execute_process(COMMAND ${PKG_CONFIG} --cflags --libs ${package}
    OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags)
  set(compiler ${COMPILER} -std=c++17)
  if(source MATCHES "[.]c$")
    set(compiler ${C_COMPILER} -std=c99)
  endif()
  execute_process(COMMAND ${compiler} ${CMAKE_CURRENT_LIST_DIR}/${source} -o ${WORK}/${program}
    ${flags} ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${WORK}/${program} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

# The host's own SUNDIALS, in the library folder beside its headers where that is not /usr.
set(where "")
if(NOT SUNDIALS STREQUAL "/usr/include")
  get_filename_component(where ${SUNDIALS} DIRECTORY)
  file(GLOB core ${where}/lib/libsundials_core.so)  # 7.x
  set(where -L${where}/lib -Wl,-rpath,${where}/lib ${core})
endif()

foreach(component IN LISTS COMPONENTS)
  if(component STREQUAL "reverse_ida")
    compile_and_run(reverse_ida reverse_ida.cpp tether-reverse-ida ${where} -lsundials_ida)
  elseif(component STREQUAL "ida_projection")
    foreach(solver IN ITEMS ida idas)
      compile_and_run(pendulum_${solver} pendulum.cpp tether-ida-projection ${where} -lsundials_${solver})
    endforeach()
    compile_and_run(pendulum_in_c ../../examples/drop_in/in_c.c tether-ida-projection ${where} -lsundials_ida -lm)
  else()
    string(REPLACE "_" "-" package tether-${component})
    compile_and_run(${component} ${component}.cpp ${package})
  endif()
endforeach()
