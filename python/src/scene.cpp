// Tether: scenes for Python. SPDX-License-Identifier: BSD-3-Clause
#include <locale>
#include <optional>
#include <pybind11/stl.h>
#include <sstream>
#include <tether/scene/files.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>

#include "bind.hpp"

namespace tether::python {

namespace {

namespace ts = tether::scene;

/// The results of a run: one entry for each record, and for each body where it belongs to bodies.
struct Film {
  std::vector<std::string> bodies;
  std::vector<double> t, position, orientation, velocity, angular_velocity;
  std::vector<double> energy, drift, penetration, residual, contacts;
  std::vector<ts::ContactEvent> events;
  ts::RunResult result;

  void record(const ts::Engine& engine) {
    t.push_back(engine.time());
    const auto add = [](std::vector<double>& to, const double* from, int n) {
      to.insert(to.end(), from, from + n);
    };
    for (const ts::BodyState& b : engine.bodies()) {
      const double wxyz[] = {b.orientation.w(), b.orientation.x(), b.orientation.y(),
                             b.orientation.z()};
      add(position, b.position.data(), 3);
      add(orientation, wxyz, 4);
      add(velocity, b.velocity.data(), 3);
      add(angular_velocity, b.angular_velocity.data(), 3);
    }
    const ts::Diagnostics d = engine.diagnostics();
    energy.push_back(d.kinetic_energy + d.potential_energy);
    drift.push_back(d.drift);
    penetration.push_back(d.penetration);
    residual.push_back(d.residual);
    contacts.push_back(d.contacts);
    const std::vector<ts::ContactEvent>& all = engine.events();  // only grows
    for (std::size_t i = events.size(); i < all.size(); ++i) events.push_back(all[i]);
  }

  Array of(const std::vector<double>& values, py::ssize_t components) const {
    const auto records = static_cast<py::ssize_t>(t.size());
    if (components == 0) return array(values, {records});
    return array(values, {records, static_cast<py::ssize_t>(bodies.size()), components});
  }
};

Film run(ts::Scene scene, std::optional<double> end, std::optional<double> every, bool files) {
  if (end) scene.end = *end;
  if (every) scene.output.every = *every;
  if (!files) scene.output.files.clear();
  Film film;
  for (const ts::Body& body : scene.bodies) film.bodies.push_back(body.name);
  ts::RunOptions options;
  options.record = [&](const ts::Engine& engine) { film.record(engine); };
  bool raised = false;
  options.interrupted = [&] {
    const py::gil_scoped_acquire python;
    raised = raised || PyErr_CheckSignals() != 0;
    return raised;
  };
  {
    const py::gil_scoped_release others_run;
    film.result = ts::run(scene, options);
  }
  if (raised) throw py::error_already_set();
  return film;
}

py::dict counts(const Film& film) {
  using namespace py::literals;
  const ts::Counts& c = film.result.counts;
  return py::dict("steps"_a = c.steps, "residual_evaluations"_a = c.residual_evaluations,
                  "projections"_a = c.projections, "contact_problems"_a = c.contact_problems,
                  "sweeps"_a = c.sweeps, "unsolved"_a = c.unsolved, "accepted"_a = c.accepted,
                  "halved"_a = c.halved, "events"_a = c.events, "impacts"_a = c.impacts);
}

py::list events(const Film& film) {
  using namespace py::literals;
  const auto body = [&](int i) -> py::object {
    if (i < 0) return py::none();
    return py::str(film.bodies[static_cast<std::size_t>(i)]);
  };
  py::list list;
  for (const ts::ContactEvent& e : film.events)
    list.append(py::dict("time"_a = e.time, "kind"_a = name(e.kind), "first"_a = body(e.first),
                         "second"_a = body(e.second), "before"_a = e.before, "after"_a = e.after,
                         "lost"_a = e.lost));
  return list;
}

void bind_run(py::module_& module) {
  using namespace py::literals;
  py::class_<Film> film(module, "Run", R"(The records of a run.

t: (T,); position, velocity, angular_velocity: (T, bodies, 3); orientation: (T, bodies, 4) as
w, x, y, z; energy, drift, penetration, residual, contacts: (T,).)");
  struct Series {
    const char *name, *what;
    std::vector<double> Film::*values;
    py::ssize_t of_body;  // components; 0: one number a record
  };
  for (const Series& each :
       {Series{"t", "times of the records, (T,), s", &Film::t, 0},
        {"position", "of centres of mass, (T, bodies, 3), m", &Film::position, 3},
        {"orientation", "body to world, (T, bodies, 4): w, x, y, z", &Film::orientation, 4},
        {"velocity", "of centres of mass, (T, bodies, 3), m/s", &Film::velocity, 3},
        {"angular_velocity", "(T, bodies, 3), rad/s", &Film::angular_velocity, 3},
        {"energy", "kinetic and potential, (T,), J", &Film::energy, 0},
        {"drift", "largest violation of a joint, (T,), m or rad", &Film::drift, 0},
        {"penetration", "the deepest, (T,), m", &Film::penetration, 0},
        {"residual", "of the last contact problem, (T,)", &Film::residual, 0},
        {"contacts", "their number, (T,)", &Film::contacts, 0}})
    film.def_property_readonly(
        each.name, [each](const Film& f) { return f.of(f.*each.values, each.of_body); }, each.what);
  film.def_readonly("bodies", &Film::bodies, "their names, in the order of the arrays")
      .def_property_readonly("events", &events, "Of the event engine, in order of time.")
      .def_property_readonly(
          "engine", [](const Film& f) { return f.result.engine; }, "smooth, stepping or event")
      .def_property_readonly(
          "failure", [](const Film& f) { return f.result.failure; },
          "Why the run could not go on; empty: it reached its end.")
      .def_property_readonly(
          "met", [](const Film& f) { return f.result.met(); },
          "Every expectation of the scene that counts was judged and holds.")
      .def_property_readonly(
          "remarks", [](const Film& f) { return f.result.remarks; },
          "data that written files do not contain")
      .def_property_readonly(
          "warnings", [](const Film& f) { return f.result.warnings; },
          "Why the motion is not to be trusted; empty: nothing was seen.")
      .def_property_readonly("counts", &counts, "work of the engine: a dict");
}

}  // namespace

void bind_scene(py::module_& module) {
  using namespace py::literals;
  module.doc() = "Rigid bodies in motion, from scene files. SI units, world axes.";
  bind_run(module);

  py::class_<ts::Scene>(module, "Scene", "A scene: every default filled in.")
      .def_readonly("name", &ts::Scene::name, "title of the scene")
      .def_readwrite("end", &ts::Scene::end, "time at which a run ends, s")
      .def_property_readonly(
          "bodies",
          [](const ts::Scene& s) {
            std::vector<std::string> names;
            for (const ts::Body& body : s.bodies) names.push_back(body.name);
            return names;
          },
          "their names")
      .def_property_readonly(
          "text", [](const ts::Scene& s) { return ts::write_scene(s); }, "The scene as TOML.")
      .def_property_readonly(
          "plan",
          [](const ts::Scene& s) {
            std::ostringstream out;
            out.imbue(std::locale::classic());
            out << ts::make_plan(s);
            return out.str();
          },
          "Which effects the scene has, and which engine moves it.")
      .def("run", &run, py::kw_only(), "end"_a = py::none(), "every"_a = py::none(),
           "files"_a = false, R"(Moves the scene to its end: a Run.

end, every: s, in place of the scene's own. files: also write what the scene's [output] names.
A run that stops early has its records up to there and says why in `failure`.)");

  module.def("read", &ts::read_scene, "path"_a,
             "A scene from a file; ValueError names its faults.");
  module.def(
      "parse", [](const std::string& text) { return ts::parse_scene(text, "scene"); }, "text"_a,
      "A scene from text (TOML).");
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const ts::SceneError& error) {
      PyErr_SetString(PyExc_ValueError, error.what());
    }
  });
}

}  // namespace tether::python
