# Tether: `cmake --build <build> --target docs`: the API reference by Doxygen, a warning is an error.
# SPDX-License-Identifier: BSD-3-Clause
find_package(Doxygen 1.9 QUIET)
if(NOT DOXYGEN_FOUND)
  add_custom_target(docs
    COMMAND ${CMAKE_COMMAND} -E echo "Doxygen was not found (Debian: doxygen); install it and configure again"
    COMMAND ${CMAKE_COMMAND} -E false)
  return()
endif()

set(DOXYGEN_HAVE_DOT NO)
set(DOXYGEN_GENERATE_LATEX NO)
set(DOXYGEN_QUIET YES)
set(DOXYGEN_WARN_AS_ERROR FAIL_ON_WARNINGS)
set(DOXYGEN_WARN_IF_UNDOCUMENTED NO)  # names and types say what a sentence would repeat
set(DOXYGEN_MACRO_EXPANSION YES)
set(DOXYGEN_EXPAND_ONLY_PREDEF YES)
set(DOXYGEN_PREDEFINED TETHER_EXPORT_BEGIN= TETHER_EXPORT_END=)
set(DOXYGEN_EXTRACT_ALL YES)
set(DOXYGEN_STRIP_FROM_PATH ${CMAKE_CURRENT_SOURCE_DIR})
set(DOXYGEN_STRIP_FROM_INC_PATH linalg/include ida_projection/include contact/include scene/include)
set(DOXYGEN_USE_MDFILE_AS_MAINPAGE ${CMAKE_CURRENT_SOURCE_DIR}/ARCHITECTURE.md)
doxygen_add_docs(docs ARCHITECTURE.md CONTRIBUTING.md SECURITY.md linalg/include ida_projection/include contact/include
  scene/include COMMENT "API reference in ${CMAKE_CURRENT_BINARY_DIR}/html")
