# Another SUNDIALS than the one the package was built for is refused: by find_package, at link, at
# run time and, where no build can serve, from source. The other SUNDIALS is a header that says so.
# SPDX-License-Identifier: BSD-3-Clause
cmake_minimum_required(VERSION 3.23)
file(REMOVE_RECURSE ${WORK})
set(ENV{PKG_CONFIG_PATH} ${PREFIX}/${LIBDIR}/pkgconfig)
set(ENV{LD_LIBRARY_PATH} ${PREFIX}/${LIBDIR})
file(READ ${SUNDIALS}/sundials/sundials_config.h true_header)
string(REGEX MATCH "SUNDIALS_VERSION \"([0-9]+)\\.([0-9]+)\\.([0-9]+)" version "${true_header}")
set(major ${CMAKE_MATCH_1})
set(minor ${CMAKE_MATCH_2})
set(patch ${CMAKE_MATCH_3})
string(REGEX MATCH "SUNDIALS_INT(32|64)_T 1" index "${true_header}")
set(bits ${CMAKE_MATCH_1})
math(EXPR other_bits "96 - ${bits}")
math(EXPR next "${major} + 1")

function(must_fail wanted)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE failed OUTPUT_VARIABLE text ERROR_VARIABLE text)
  string(REGEX REPLACE "[ \n]+" " " text "${text}")
  if(NOT failed OR NOT text MATCHES "${wanted}")
    message(SEND_ERROR "Expected a stop with '${wanted}' of ${ARGN}:\n${text}")
  endif()
endfunction()

function(compile wanted)
  execute_process(COMMAND ${PKG_CONFIG} --cflags --libs tether-ida-projection
    OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  separate_arguments(flags)
  get_filename_component(where ${SUNDIALS} DIRECTORY)
  set(libraries -lsundials_ida)
  if(NOT SUNDIALS STREQUAL "/usr/include")
    file(GLOB core ${where}/lib/libsundials_core.so)  # 7.x
    set(libraries -L${where}/lib -Wl,-rpath,${where}/lib ${core} ${libraries})
  endif()
  set(command ${COMPILER} -std=c++17 ${ARGN} ${CMAKE_CURRENT_LIST_DIR}/pendulum.cpp -o ${WORK}/pendulum
    ${flags} ${libraries})
  if(wanted)
    must_fail("${wanted}" ${command})
  else()
    execute_process(COMMAND ${command} COMMAND_ERROR_IS_FATAL ANY)
  endif()
endfunction()

# other(<name> <text> <replacement> ...): headers in WORK/<name>, found before the true ones.
function(other name)
  set(header "${true_header}")
  while(ARGN)
    list(POP_FRONT ARGN from to)
    string(REPLACE "${from}" "${to}" header "${header}")
  endwhile()
  if(header STREQUAL true_header)
    message(FATAL_ERROR "sundials_config.h has another form than this test expects")
  endif()
  file(WRITE ${WORK}/${name}/sundials/sundials_config.h "${header}")
  file(WRITE ${WORK}/${name}/ida/ida.h "#include_next <ida/ida.h>\n")
endfunction()
set(use_mock -DCMAKE_DISABLE_FIND_PACKAGE_SUNDIALS=ON)
function(find name wanted)
  must_fail("built for SUNDIALS ${major}\\.${minor}\\.${patch} \\(double precision, ${bits}-bit indices\\), but SUNDIALS ${wanted} was found"
    ${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/find_package -B ${WORK}/${name}/build ${ARGUMENTS}
    ${use_mock} -DTETHER_SUNDIALS_INCLUDE_DIR=${WORK}/${name} -Dtether_ROOT=${PREFIX}
    -DTETHER_COMPONENTS=ida_projection)
endfunction()

other(next "SUNDIALS_VERSION \"${major}.${minor}.${patch}" "SUNDIALS_VERSION \"${next}.0.0"
  "SUNDIALS_VERSION_MAJOR ${major}" "SUNDIALS_VERSION_MAJOR ${next}")
find(next "${next}\\.0\\.0 \\(double precision, ${bits}-bit indices\\)")
compile("undefined .*tether_built_for_sundials_${next}_double_index${bits}" -I${WORK}/next)

other(index "SUNDIALS_INT${bits}_T 1" "SUNDIALS_INT${other_bits}_T 1")
find(index "[0-9.]+ \\(double precision, ${other_bits}-bit indices\\)")
compile("undefined .*tether_built_for_sundials_${major}_double_index${other_bits}" -I${WORK}/index)

foreach(precision IN ITEMS SINGLE EXTENDED)
  other(${precision} "SUNDIALS_DOUBLE_PRECISION 1" "SUNDIALS_${precision}_PRECISION 1")
  compile("needs a SUNDIALS in double precision" -I${WORK}/${precision})
  string(TOLOWER ${precision} word)
  must_fail("SUNDIALS [0-9.]+ \\(${word} precision, ${bits}-bit indices\\) in .*: Tether needs double precision"
    ${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/${precision}/build ${ARGUMENTS} ${use_mock}
    -DTETHER_SUNDIALS_INCLUDE_DIR=${WORK}/${precision} -DTETHER_BUILD_CONTACT=OFF -DTETHER_BUILD_TESTS=OFF
    -DTETHER_BUILD_EXAMPLES=OFF -DTETHER_BUILD_BENCHMARKS=OFF)
endforeach()

# The program's own answer stands for that of another shared library.
file(WRITE ${WORK}/version.cpp "#include <sundials/sundials_version.h>
extern \"C\" int SUNDIALSGetVersionNumber(int* a, int* b, int* c, char*, int) { *a = ${next}; *b = 5; *c = 0; return 0; }\n")
compile("" ${WORK}/version.cpp)
must_fail("this is SUNDIALS ${next}\\.5\\.0, but the plugin was compiled with SUNDIALS ${major}\\.${minor}\\.${patch}"
  ${WORK}/pendulum)
