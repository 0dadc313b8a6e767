// Tether: the Python module. SPDX-License-Identifier: BSD-3-Clause
#include "bind.hpp"

PYBIND11_MODULE(_tether, module) {
  namespace py = tether::python::py;
  module.attr("__version__") = TETHER_VERSION;
  py::module_ contact = module.def_submodule("contact");
  tether::python::bind_contact(contact);
  py::module_ ida = module.def_submodule("ida");
  tether::python::bind_ida(ida);
  py::module_ scene = module.def_submodule("scene");
  tether::python::bind_scene(scene);
}
