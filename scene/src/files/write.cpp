// Tether: a scene as TOML, every default spelt out. SPDX-License-Identifier: BSD-3-Clause
#include "read.hpp"

namespace tether::scene {

std::string write_scene(const Scene& of) {
  Scene scene = of;  // forms change what they read
  files::Writer out;
  const files::Form form(out, of);
  const auto options = [&](const char* key, auto& values) {
    if (!values) return;
    out.table(key);
    files::each_field(*values, form);
  };
  out.table("scene");
  files::scene_fields(form, scene);
  options("smooth", scene.smooth);
  options("stepping", scene.stepping);
  options("event", scene.event);
  out.table("output");
  files::output_fields(form, scene.output);
  for (Body& body : scene.bodies) {
    out.item("body");
    files::body_fields(form, body);
  }
  files::list_fields(form, scene);
  files::expect_fields(form, scene);
  return out.take().substr(1);
}

}  // namespace tether::scene
