# Tether: `cmake --build <build> --target docs`: the site of all documents, with the API reference by Doxygen, in which a
# warning is an error. SPDX-License-Identifier: BSD-3-Clause
find_package(Python3 3.9 QUIET COMPONENTS Interpreter)
find_program(TETHER_MKDOCS mkdocs)
find_package(Doxygen 1.9 QUIET)
mark_as_advanced(TETHER_MKDOCS)
if(NOT Python3_FOUND OR NOT TETHER_MKDOCS OR NOT DOXYGEN_FOUND)
  add_custom_target(docs
    COMMAND ${CMAKE_COMMAND} -E echo "The site needs packages of Debian: apt-get install mkdocs-material python3-pymdownx libjs-katex doxygen; then configure again"
    COMMAND ${CMAKE_COMMAND} -E false)
  return()
endif()

set(DOXYGEN_HAVE_DOT NO)
set(DOXYGEN_GENERATE_LATEX NO)
set(DOXYGEN_QUIET YES)
set(DOXYGEN_WARN_AS_ERROR FAIL_ON_WARNINGS)
set(DOXYGEN_MACRO_EXPANSION YES)
set(DOXYGEN_EXPAND_ONLY_PREDEF YES)
set(DOXYGEN_PREDEFINED TETHER_EXPORT_BEGIN= TETHER_EXPORT_END= TETHER_HIDDEN=)
set(DOXYGEN_INPUT_FILTER "${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/docs/declarations.py")
set(DOXYGEN_EXCLUDE_SYMBOLS tether::*::detail tether::*::detail::* tether::linalg::small*)
set(DOXYGEN_FILE_PATTERNS *.hpp *.h *.md)
set(DOXYGEN_STRIP_FROM_PATH ${CMAKE_CURRENT_SOURCE_DIR})
set(DOXYGEN_STRIP_FROM_INC_PATH linalg/include ida_projection/include contact/include scene/include)
set(DOXYGEN_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/docs)
set(first ${CMAKE_CURRENT_BINARY_DIR}/docs/classes.md)
file(CONFIGURE OUTPUT ${first} CONTENT "# Tether: classes and functions

Each library has a header that includes all of its public ones: tether/linalg.hpp, tether/ida_projection.hpp,
tether/contact.hpp, tether/scene.hpp. Their namespaces are tether::linalg, tether::ida_projection, tether::contact and
tether::scene. The [guides and tutorials](../index.html) tell how to use them.
")
set(DOXYGEN_USE_MDFILE_AS_MAINPAGE ${first})
doxygen_add_docs(reference ${first} linalg/include ida_projection/include contact/include scene/include
  COMMENT "API reference")
# A public member without a comment is a warning, and a warning an error.
if(TETHER_BUILD_TESTS)
  set(doxyfile ${CMAKE_CURRENT_BINARY_DIR}/docs/Doxyfile.tested)
  file(CONFIGURE OUTPUT ${doxyfile} CONTENT "@INCLUDE = ${CMAKE_CURRENT_BINARY_DIR}/Doxyfile.reference
OUTPUT_DIRECTORY = ${CMAKE_CURRENT_BINARY_DIR}/docs/tested
GENERATE_HTML = NO
GENERATE_XML = YES
" @ONLY)
  add_test(NAME "docs: every public member has a comment" COMMAND Doxygen::doxygen ${doxyfile}
    WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  set_tests_properties("docs: every public member has a comment" PROPERTIES LABELS docs)
endif()
add_custom_target(docs
  COMMAND ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/docs/pages.py ${CMAKE_CURRENT_BINARY_DIR}/docs
    ${CMAKE_CURRENT_BINARY_DIR}/docs/html
  COMMENT "The site, with every link checked")
add_dependencies(docs reference)
