# vcpkg, from a checkout of Tether: vcpkg install tether --overlay-ports=packaging/vcpkg
# SPDX-License-Identifier: BSD-3-Clause
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

vcpkg_check_features(OUT_FEATURE_OPTIONS features
  FEATURES scene TETHER_BUILD_SCENE
  INVERTED_FEATURES reverse CMAKE_DISABLE_FIND_PACKAGE_Boost hdf5 CMAKE_DISABLE_FIND_PACKAGE_HDF5)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    ${features}
    -DTETHER_BUILD_CONTACT_MPI=OFF
    -DTETHER_BUILD_PYTHON=OFF
    -DTETHER_BUILD_TESTS=OFF
    -DTETHER_BUILD_EXAMPLES=OFF
    -DTETHER_BUILD_BENCHMARKS=OFF
  MAYBE_UNUSED_VARIABLES CMAKE_DISABLE_FIND_PACKAGE_Boost CMAKE_DISABLE_FIND_PACKAGE_HDF5)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/tether)
vcpkg_fixup_pkgconfig()
if("scene" IN_LIST FEATURES)
  vcpkg_copy_tools(TOOL_NAMES tether AUTO_CLEAN)
endif()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
