# tether_library(name): target tether_<name>, alias tether::<name>, C++17, warnings of the project.
include(GNUInstallDirs)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES AND PROJECT_IS_TOP_LEVEL)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

function(tether_warnings target)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wpedantic -Wshadow>
    $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<BOOL:${TETHER_WARNINGS_AS_ERRORS}>>:-Werror>)
endfunction()

function(tether_library name)
  add_library(tether_${name})
  add_library(tether::${name} ALIAS tether_${name})
  target_compile_features(tether_${name} PUBLIC cxx_std_17)
  set_target_properties(tether_${name} PROPERTIES
    EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON CXX_EXTENSIONS OFF
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  tether_warnings(tether_${name})
endfunction()
