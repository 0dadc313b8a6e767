# SPDX-License-Identifier: BSD-3-Clause
"""Spack: from a checkout of Tether,

    spack repo add packaging/spack
    spack dev-build tether
"""

from spack.package import *


class Tether(CMakePackage):
    """Keeps a computed motion on the constraints that it must obey: projection for SUNDIALS IDA,
    frictional rigid-body contact, scenes."""

    license("BSD-3-Clause")
    version("0.2.0")

    variant("shared", default=True, description="Shared libraries")
    variant("scene", default=True, description="Scenes and the program `tether`")
    variant("mpi", default=False, description="Contact over MPI ranks")
    variant("reverse", default=True, description="IDA by reverse communication")
    variant("hdf5", default=True, description="Contact problems in fclib's files")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.23:", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("eigen@3.4")
    depends_on("sundials@6.4:7 precision=double +ida +idas +klu")
    depends_on("boost@1.74: +context", when="+reverse")
    depends_on("hdf5", when="+hdf5")
    depends_on("mpi", when="+mpi")
    with when("+scene"):
        depends_on("fmt")
        depends_on("tomlplusplus")
        depends_on("nlohmann-json")
        depends_on("cli11")
        depends_on("tinyxml2")

    def cmake_args(self):
        return [
            self.define_from_variant("BUILD_SHARED_LIBS", "shared"),
            self.define_from_variant("TETHER_BUILD_SCENE", "scene"),
            self.define_from_variant("TETHER_BUILD_CONTACT_MPI", "mpi"),
            self.define("CMAKE_DISABLE_FIND_PACKAGE_Boost", not self.spec.satisfies("+reverse")),
            self.define("CMAKE_DISABLE_FIND_PACKAGE_HDF5", not self.spec.satisfies("+hdf5")),
            self.define("TETHER_BUILD_PYTHON", False),
            self.define("TETHER_BUILD_TESTS", False),
            self.define("TETHER_BUILD_EXAMPLES", False),
            self.define("TETHER_BUILD_BENCHMARKS", False),
        ]
