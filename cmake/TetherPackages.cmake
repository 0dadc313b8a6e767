# Debian packages by cpack: libtether (shared libraries), libtether-dev (headers, CMake and pkg-config
# files), tether (the program). SPDX-License-Identifier: BSD-3-Clause
#
#   cmake --preset debian && cmake --build --preset debian && cd build/debian && cpack
#
# One libtether holds all libraries. With SOURCE_DATE_EPOCH in the environment of both the configuration
# and cpack the same sources give the same bytes; without, the changelog has the time of the last commit.
if(NOT BUILD_SHARED_LIBS OR NOT TARGET tether_program)
  message(FATAL_ERROR "TETHER_DEBIAN_PACKAGES needs BUILD_SHARED_LIBS=ON and the program `tether` "
    "(packages in cmake/packages.txt); the preset `debian` has the former")
endif()
find_program(TETHER_GZIP gzip REQUIRED)

set(tether_packages libtether libtether-dev tether)
set(CPACK_PACKAGE_CONTACT "Tether maintainers <tether@example.org>" CACHE STRING
  "Name <address> of who makes the packages")
set(tether_package_dir ${PROJECT_BINARY_DIR}/package)

if("$ENV{SOURCE_DATE_EPOCH}" STREQUAL "")
  find_package(Git QUIET)
  if(Git_FOUND)
    execute_process(COMMAND ${GIT_EXECUTABLE} log -1 --format=%ct
      WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE seconds
      OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    set(ENV{SOURCE_DATE_EPOCH} "${seconds}")
  endif()
endif()
string(TIMESTAMP tether_package_date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # heeds SOURCE_DATE_EPOCH

# Maintainer scripts and texts that policy wants in each package.
configure_file(${PROJECT_SOURCE_DIR}/packaging/debian/copyright.in ${tether_package_dir}/copyright @ONLY)
foreach(package IN LISTS tether_packages)
  set(tether_package ${package})
  set(folder ${tether_package_dir}/${package})
  configure_file(${PROJECT_SOURCE_DIR}/packaging/debian/changelog.in ${folder}/changelog @ONLY)
  execute_process(COMMAND ${TETHER_GZIP} -9nf ${folder}/changelog COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${tether_package_dir}/copyright ${folder}/changelog.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${package})
endforeach()

configure_file(${PROJECT_SOURCE_DIR}/packaging/tether.1 ${tether_package_dir}/tether.1 COPYONLY)
execute_process(COMMAND ${TETHER_GZIP} -9nf ${tether_package_dir}/tether.1 COMMAND_ERROR_IS_FATAL ANY)
install(FILES ${tether_package_dir}/tether.1.gz
  DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT tether)

# Packages that compiling against the libraries needs.
set(tether_dev_needs "libtether (= ${PROJECT_VERSION})" libeigen3-dev)
if(TARGET tether_ida_projection)
  list(APPEND tether_dev_needs libsundials-dev)
endif()
string(JOIN ", " tether_dev_needs ${tether_dev_needs})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME tether)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_HOMEPAGE_URL "${PROJECT_HOMEPAGE_URL}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL ${tether_packages})
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
foreach(library IN LISTS tether_libraries)
  get_target_property(folder tether_${library} BINARY_DIR)  # where cpack finds them
  list(APPEND CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${folder})
endforeach()
list(REMOVE_DUPLICATES CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS)

# The soname of each library, for packages that link it, and the trigger of ldconfig that Debian's policy
# wants; cpack adds a script that runs it, too.
set(shlibs "")
foreach(library IN LISTS tether_libraries)
  get_target_property(soversion tether_${library} SOVERSION)
  string(APPEND shlibs "libtether_${library} ${soversion} libtether (= ${PROJECT_VERSION})\n")
endforeach()
file(CONFIGURE OUTPUT ${tether_package_dir}/libtether/shlibs CONTENT "${shlibs}")
file(CONFIGURE OUTPUT ${tether_package_dir}/libtether/triggers CONTENT "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_LIBTETHER_PACKAGE_CONTROL_EXTRA
  ${tether_package_dir}/libtether/shlibs ${tether_package_dir}/libtether/triggers)
if(TARGET tether_preload)  # all that lies in a folder of libraries has a soname
  target_link_options(tether_preload PRIVATE LINKER:-soname,libtether_preload.so)
endif()

foreach(package IN LISTS tether_packages)
  string(TOUPPER ${package} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
endforeach()
set(CPACK_DEBIAN_LIBTETHER_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBTETHER-DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_TETHER_PACKAGE_SECTION science)
set(CPACK_DEBIAN_LIBTETHER-DEV_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_LIBTETHER-DEV_PACKAGE_DEPENDS "${tether_dev_needs}")
set(CPACK_DEBIAN_TETHER_PACKAGE_DEPENDS "libtether (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_TETHER_PACKAGE_SUGGESTS "libtether-dev")
set(summary "motions kept on their constraints")
set(about "Tether projects the steps of SUNDIALS IDA onto invariants and
constraints, solves frictional contact problems with the exact friction
cone, and moves scenes of rigid bodies.")
set(CPACK_COMPONENT_LIBTETHER_DESCRIPTION "${summary}: libraries
${about}
This package has the shared libraries.")
set(CPACK_COMPONENT_LIBTETHER-DEV_DESCRIPTION "${summary}: development files
${about}
This package has headers, and files for CMake and pkg-config.")
set(CPACK_COMPONENT_TETHER_DESCRIPTION "${summary}: program
${about}
This package has the program tether, which checks, plans, runs and prices
scene files.")

include(CPack)
