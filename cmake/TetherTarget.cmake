# Common to every target of the project: C++17, warnings, sanitizers, and for a library its
# alias and install rules. No global flags: a project that adds Tether as a subdirectory keeps its own.
# SPDX-License-Identifier: BSD-3-Clause
#
#   tether_compile_options(<target>)    warnings and instrumentation of the project, and the compiler's memory
#   tether_optimise_little(<target>)    in Release: for programs whose time passes in the libraries
#   tether_executable(<target> SOURCES ... LIBRARIES ...)
#   tether_library(<name>)       target tether_<name>, alias tether::<name>
#   tether_list(<target> <macro> <file> <sources>...)  a list of sources for the preprocessor
#   tether_by_folders(<target>)  with TETHER_UNITY_BUILD: the sources of a folder compile as one
#   tether_precompile(<target> <header> ...)  with TETHER_UNITY_BUILD: compiled once for the target's sources
#   TETHER_KEEP_BITS             options for sources whose rounding is part of their promise
include(GNUInstallDirs)
include(${CMAKE_CURRENT_LIST_DIR}/TetherPrivate.cmake)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES AND PROJECT_IS_TOP_LEVEL)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

function(tether_compile_options target)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow>
    $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<BOOL:${TETHER_WARNINGS_AS_ERRORS}>>:-Werror>
    # GCC collects its garbage above 128 MB by default, which takes time and saves little memory.
    "$<$<COMPILE_LANG_AND_ID:CXX,GNU>:SHELL:--param ggc-min-heapsize=524288>")
  if(TETHER_SANITIZERS)
    target_compile_options(${target} PRIVATE
      -fsanitize=${TETHER_SANITIZERS} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PRIVATE -fsanitize=${TETHER_SANITIZERS})
  endif()
  if(TETHER_COVERAGE)
    target_compile_options(${target} PRIVATE --coverage)
    target_link_options(${target} PRIVATE --coverage)
  endif()
endfunction()

# For programs whose time passes in the libraries. GCC compiles tests in three quarters of the time of -O1 so; with -O0
# its output is three times as long, and takes longer to write. Below -O2 GCC suspects initialised members.
function(tether_optimise_little target)
  target_compile_options(${target} PRIVATE $<$<AND:$<CONFIG:Release>,$<CXX_COMPILER_ID:GNU,Clang,AppleClang>>:-Og>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endfunction()

# For sources whose results must be the same bits wherever they are compiled; after the builder's flags.
set(TETHER_KEEP_BITS "$<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-fno-fast-math;-ffp-contract=off>")

function(tether_executable target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
  add_executable(${target} ${arg_SOURCES})
  target_link_libraries(${target} PRIVATE ${arg_LIBRARIES})
  target_compile_features(${target} PRIVATE cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  tether_compile_options(${target})
endfunction()

# The sources of a folder compile as one: names in unnamed namespaces differ within a folder.
function(tether_group_by_folder target)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE OUTPUT_VARIABLE folder)
    cmake_path(RELATIVE_PATH folder BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
    cmake_path(GET folder PARENT_PATH folder)
    string(MAKE_C_IDENTIFIER "in_${folder}" group)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
endfunction()

# With TETHER_UNITY_BUILD: see above.
function(tether_by_folders target)
  if(TETHER_UNITY_BUILD)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
    cmake_language(EVAL CODE "cmake_language(DEFER CALL tether_group_by_folder ${target})")
    # A source that another one includes is no header: its unnamed namespace may be in its classes.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# Saves reading the same headers for many small sources. Builds without TETHER_UNITY_BUILD show a missing include.
function(tether_precompile target)
  if(TETHER_UNITY_BUILD)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    # ccache asks for it.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  endif()
endfunction()

# Writes <file> with <macro>(name) for each source <name>.cpp, so that the list of sources is the list of what the
# library has.
function(tether_list target macro file)
  list(TRANSFORM ARGN REPLACE "^.*/" "" OUTPUT_VARIABLE entries)
  list(TRANSFORM entries REPLACE "^(.*)[.]cpp$" "${macro}(\\1)\n")
  string(JOIN "" entries ${entries})
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${file} CONTENT "${entries}")
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
endfunction()

function(tether_library name)
  add_library(tether_${name})
  add_library(tether::${name} ALIAS tether_${name})
  target_compile_features(tether_${name} PUBLIC cxx_std_17)
  set_target_properties(tether_${name} PROPERTIES
    EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON CXX_EXTENSIONS OFF
    VERIFY_INTERFACE_HEADER_SETS ON
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON  # see tether/export.hpp
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  # Installed shared libraries find each other in their own folder.
  set_target_properties(tether_${name} PROPERTIES INSTALL_RPATH $<IF:$<PLATFORM_ID:Darwin>,@loader_path,$ORIGIN>)
  tether_compile_options(tether_${name})
  tether_by_folders(tether_${name})
  tether_keep_private(tether_${name})
  set_property(GLOBAL APPEND PROPERTY TETHER_LIBRARIES ${name})
endfunction()
