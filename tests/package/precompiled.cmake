# Half the time of the libraries that the package tests compile again: Eigen and the standard headers
# once for each library. (The project itself is compiled without, so that a missing include shows.)
# Also contact by folders, with TETHER_UNITY_BUILD: which of its objects a program links is looked at elsewhere.
# SPDX-License-Identifier: BSD-3-Clause
function(tether_precompile_headers)
  get_property(libraries GLOBAL PROPERTY TETHER_LIBRARIES)
  foreach(library IN LISTS libraries)
    target_precompile_headers(tether_${library} PRIVATE
      <Eigen/Dense> <algorithm> <functional> <memory> <optional> <string> <variant> <vector>)
  endforeach()
  if(TARGET tether_contact)
    set_target_properties(tether_contact PROPERTIES UNITY_BUILD ${TETHER_UNITY_BUILD})
  endif()
endfunction()
cmake_language(DEFER CALL tether_precompile_headers)
