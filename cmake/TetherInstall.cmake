# Install rules: one component for each library, a package config, a version file, pkg-config files.
# SPDX-License-Identifier: BSD-3-Clause
#
# Components: linalg (with the package files that all need), ida_projection, reverse_ida (on it),
# contact, contact_io and contact_mpi (on contact), scene (on all of these but
# reverse_ida, contact_io and contact_mpi). Each library builds alone
# (TETHER_BUILD_*) and installs alone on top of those that it stands on:
#
#   cmake --install build --component linalg
#   cmake --install build --component contact
#
# With TETHER_DEBIAN_PACKAGES the components are those packages (TetherPackages.cmake).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(tether_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/tether)
get_property(tether_libraries GLOBAL PROPERTY TETHER_LIBRARIES)

# Components of what a library needs to run, and of what serves those who compile against it.
macro(tether_components library)
  set(tether_run ${library})
  set(tether_dev ${library})
  if(TETHER_DEBIAN_PACKAGES)
    set(tether_run libtether)
    set(tether_dev libtether-dev)
  endif()
endmacro()

foreach(library IN LISTS tether_libraries)
  tether_components(${library})
  install(TARGETS tether_${library} EXPORT tether-${library}-targets
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${tether_run}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${tether_run} NAMELINK_COMPONENT ${tether_dev}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${tether_dev}
    FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT ${tether_dev})
  install(EXPORT tether-${library}-targets NAMESPACE tether::
    DESTINATION ${tether_cmake_dir} COMPONENT ${tether_dev})
endforeach()

# Need deal.II or MPI, so they are in no set of headers that are compiled one by one.
if(TARGET tether_ida_projection)
  tether_components(ida_projection)
  set(tether_ida_headers ${PROJECT_SOURCE_DIR}/ida_projection/include/tether/ida_projection)
  install(FILES ${tether_ida_headers}/deal_ii.hpp ${tether_ida_headers}/mpi_rows.hpp
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tether/ida_projection COMPONENT ${tether_dev})
endif()

if(TARGET tether_preload)
  tether_components(ida_projection)
  install(TARGETS tether_preload LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${tether_run})
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/ida_projection/octave
    DESTINATION ${CMAKE_INSTALL_DATADIR}/tether COMPONENT ${tether_dev} PATTERN check.sh EXCLUDE)
endif()

# Components that the config has to find and include.
set(tether_needs_scene ida_projection contact)
set(tether_has_hdf5 FALSE)
if(TARGET tether::hdf5)
  set(tether_has_hdf5 TRUE)
endif()
foreach(library IN ITEMS contact_io contact_mpi)
  if(TARGET tether_${library})
    tether_components(${library})
    install(FILES ${CMAKE_CURRENT_LIST_DIR}/TetherExternal.cmake
      DESTINATION ${tether_cmake_dir} COMPONENT ${tether_dev})
  endif()
endforeach()

# The standard library of the libraries, which a program must share: standard_library.hpp.in has the numbers.
string(TOUPPER "CMAKE_CXX_FLAGS_${CMAKE_BUILD_TYPE}" tether_flags)
separate_arguments(tether_flags UNIX_COMMAND "${CMAKE_CXX_FLAGS} ${${tether_flags}}")
get_directory_property(tether_definitions COMPILE_DEFINITIONS)
list(TRANSFORM tether_definitions PREPEND -D)
file(WRITE ${PROJECT_BINARY_DIR}/package/macros.cpp "#include <cstddef>\n")
execute_process(COMMAND ${CMAKE_CXX_COMPILER} ${tether_flags} ${tether_definitions} -E -dM
    ${PROJECT_BINARY_DIR}/package/macros.cpp
  OUTPUT_VARIABLE tether_macros COMMAND_ERROR_IS_FATAL ANY)
set(tether_standard_library 0)
set(tether_standard_library_text "neither libstdc++ nor libc++")
if(tether_macros MATCHES "#define _LIBCPP_ABI_VERSION ([0-9]+)")
  math(EXPR tether_standard_library "2000 + ${CMAKE_MATCH_1}")
  set(tether_standard_library_text "libc++ and _LIBCPP_ABI_VERSION=${CMAKE_MATCH_1}")
elseif(tether_macros MATCHES "#define _GLIBCXX_USE_CXX11_ABI ([0-9]+)")
  math(EXPR tether_standard_library "1000 + ${CMAKE_MATCH_1}")
  set(tether_standard_library_text "_GLIBCXX_USE_CXX11_ABI=${CMAKE_MATCH_1} and without _GLIBCXX_DEBUG")
  if(tether_macros MATCHES "#define _GLIBCXX_DEBUG[ \n]")
    math(EXPR tether_standard_library "${tether_standard_library} + 10")
    string(REPLACE without with tether_standard_library_text "${tether_standard_library_text}")
  endif()
endif()
configure_file(${PROJECT_SOURCE_DIR}/cmake/standard_library.hpp.in
  ${PROJECT_BINARY_DIR}/package/standard_library.hpp @ONLY)
tether_components(linalg)
install(FILES ${PROJECT_BINARY_DIR}/package/standard_library.hpp
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tether COMPONENT ${tether_dev})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/tether-config.cmake.in
  ${PROJECT_BINARY_DIR}/package/tether-config.cmake INSTALL_DESTINATION ${tether_cmake_dir}
  PATH_VARS CMAKE_INSTALL_INCLUDEDIR NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/tether-config-version.cmake
  COMPATIBILITY SameMinorVersion)
tether_components(linalg)
install(FILES
    ${PROJECT_BINARY_DIR}/package/tether-config.cmake
    ${PROJECT_BINARY_DIR}/package/tether-config-version.cmake
  DESTINATION ${tether_cmake_dir} COMPONENT ${tether_dev})
if(NOT TETHER_DEBIAN_PACKAGES)  # they have a copyright file each
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE
    DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT linalg)
endif()

# pkg-config: paths relative to the .pc file, so that an installed tree can be moved; absolute only
# where the caller made them so.
file(RELATIVE_PATH tether_pc_prefix
  ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" tether_pc_prefix "${tether_pc_prefix}")
foreach(kind IN ITEMS LIB INCLUDE)
  set(tether_pc_${kind} ${CMAKE_INSTALL_${kind}DIR})
  if(NOT IS_ABSOLUTE "${tether_pc_${kind}}")
    string(PREPEND tether_pc_${kind} "\${prefix}/")
  endif()
endforeach()
function(tether_pkg_config library description requires)
  if(NOT TARGET tether_${library})
    return()
  endif()
  cmake_parse_arguments(PARSE_ARGV 3 arg "" "" "CFLAGS;LIBS")
  string(REPLACE "_" "-" name tether-${library})
  string(JOIN " " cflags ${arg_CFLAGS})
  list(TRANSFORM arg_LIBS PREPEND " ")
  string(JOIN "" libs ${arg_LIBS})
  configure_file(${PROJECT_SOURCE_DIR}/cmake/tether.pc.in ${PROJECT_BINARY_DIR}/package/${name}.pc @ONLY)
  tether_components(${library})
  install(FILES ${PROJECT_BINARY_DIR}/package/${name}.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT ${tether_dev})
endfunction()

tether_pkg_config(linalg "Minimum-norm solves shared by Tether's libraries" "eigen3 >= 3.4")
tether_pkg_config(contact "Rigid-body contact with the exact friction cone"
  "tether-linalg = ${PROJECT_VERSION}" LIBS ${CMAKE_THREAD_LIBS_INIT})
if(TARGET tether_ida_projection)
  tether_components(ida_projection)
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/TetherSundials.cmake
    DESTINATION ${tether_cmake_dir} COMPONENT ${tether_dev})
  # Debian has no sundials.pc, so the include directory is named; the host links its own IDA or IDAS.
  get_target_property(sundials_include tether::sundials_headers INTERFACE_INCLUDE_DIRECTORIES)
  list(TRANSFORM sundials_include PREPEND "-I")
  get_property(runtime GLOBAL PROPERTY TETHER_CXX_RUNTIME)
  list(TRANSFORM runtime PREPEND -l)
  tether_pkg_config(ida_projection "Constraint projection for SUNDIALS IDA and IDAS"
    "tether-linalg = ${PROJECT_VERSION}" CFLAGS ${sundials_include} LIBS ${runtime})
endif()
if(TARGET tether_reverse_ida)
  tether_components(reverse_ida)
  install(FILES ${PROJECT_SOURCE_DIR}/ida_projection/include/tether/reverse_ida.f90
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tether COMPONENT ${tether_dev})
  set(context "")
  if(NOT BUILD_SHARED_LIBS)
    set(context -lboost_context)
  endif()
  tether_pkg_config(reverse_ida "IDA by reverse communication" "tether-ida-projection = ${PROJECT_VERSION}"
    LIBS ${context})
endif()
# A static library leaves its own libraries to the program.
set(hdf5_libs "")
set(scene_libs "")
if(NOT BUILD_SHARED_LIBS)
  if(TARGET tether::hdf5)
    get_target_property(hdf5_libs tether::hdf5 INTERFACE_LINK_LIBRARIES)
    list(TRANSFORM hdf5_libs REPLACE "^([^/-].*)$" "-l\\1")
  endif()
  set(scene_libs -lfmt -ltomlplusplus)
  if(TARGET tether::sundials_klu)
    list(APPEND scene_libs -lsundials_sunlinsolklu -lsundials_sunmatrixsparse)
  endif()
  list(APPEND scene_libs -lsundials_ida)
endif()
tether_pkg_config(contact_io "Contact problems in files" "tether-contact = ${PROJECT_VERSION}"
  LIBS ${hdf5_libs})
if(TARGET tether_contact_mpi)
  get_target_property(mpi_include MPI::MPI_CXX INTERFACE_INCLUDE_DIRECTORIES)
  get_target_property(mpi_libs MPI::MPI_CXX INTERFACE_LINK_LIBRARIES)
  list(TRANSFORM mpi_include PREPEND "-I")
  tether_pkg_config(contact_mpi "Contacts of bodies over MPI ranks" "tether-contact = ${PROJECT_VERSION}"
    CFLAGS ${mpi_include} LIBS ${mpi_libs})
endif()
set(scene_requires "tether-ida-projection = ${PROJECT_VERSION}, tether-contact = ${PROJECT_VERSION}")
tether_pkg_config(scene "Rigid bodies in motion, from scene files" "${scene_requires}"
  LIBS ${scene_libs})
