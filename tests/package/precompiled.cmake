# Half the time of the libraries that the package tests compile again: Eigen and the standard headers
# once for each library. (The project itself is compiled without, so that a missing include shows.)
# SPDX-License-Identifier: BSD-3-Clause
function(tether_precompile_headers)
  get_property(libraries GLOBAL PROPERTY TETHER_LIBRARIES)
  foreach(library IN LISTS libraries)
    target_precompile_headers(tether_${library} PRIVATE
      <Eigen/Dense> <algorithm> <functional> <memory> <optional> <string> <variant> <vector>)
  endforeach()
endfunction()
cmake_language(DEFER CALL tether_precompile_headers)
