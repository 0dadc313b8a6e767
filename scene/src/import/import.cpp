// Tether: robots of other programs as scenes. SPDX-License-Identifier: BSD-3-Clause
#include "import/import.hpp"

#include <fmt/format.h>

#include <exception>
#include <tether/scene/run.hpp>

#include "bounds.hpp"
#include "parts.hpp"

namespace tether::scene::import {

namespace {

/// One line that a comment of TOML may hold: texts of the file end no comment.
std::string in_comment(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return text;
}

std::string heading(const Model& model, const std::string& file, const Draft& draft,
                    const std::vector<std::string>& remarks) {
  const Scene& scene = draft.scene;
  std::vector<std::string> lines{
      fmt::format("{}: from {} ({}) by tether import. Moving bodies: {}, joints: {}.",
                  model.name.empty() ? "A robot" : model.name, file,
                  model.format == Format::urdf ? "URDF" : "MJCF", scene.moving().size(),
                  scene.joints.size()),
      "Positions are those of the centres of mass, at the start; units are SI."};
  if (!remarks.empty()) lines.insert(lines.end(), {"", "Left out or changed:"});
  for (const std::string& remark : remarks) lines.push_back("  " + remark);
  std::string out;
  for (const std::string& line : lines)
    out += line.empty() ? "#\n" : "# " + in_comment(line) + "\n";
  return out + "\n";
}

/// Puts each comment behind its table's header: the n-th "[[kind]]" has the n-th one.
std::string with_comments(const std::string& toml, const std::string& kind,
                          const std::vector<std::string>& comments) {
  const std::string header = "\n[[" + kind + "]]\n";
  std::string out;
  std::size_t from = 0;
  for (const std::string& comment : comments) {
    const std::size_t at = toml.find(header, from);
    if (at == std::string::npos) break;
    out += toml.substr(from, at - from) + "\n[[" + kind + "]]  # " + in_comment(comment) + "\n";
    from = at + header.size();
  }
  return out + toml.substr(from);
}

Model read(const Node& root, Problems& problems) {
  if (is(root, "robot")) return read_urdf(root, problems);
  if (is(root, "mujoco")) return read_mjcf(root, problems);
  problems.add(root, "",
               is(root, "sdf") ? "SDF is not read; its tools write URDF"
                               : "must be <robot> (URDF) or <mujoco> (MJCF)");
  problems.finish();
  return {};
}

Imported convert(std::string_view text, const std::string& file, const ImportOptions& options) {
  Problems problems(file, options.files);
  Document document(text, problems);
  if (is(document.root(), "mujoco")) document.include_files(problems);
  Model model = read(document.root(), problems);
  problems.finish();
  make_convex(model, options.hulls);
  if (model.step > 0 && !(options.end / model.step <= kMostSteps))
    problems.add(
        document.root().GetLineNum(), "option: timestep", fmt::format("{}", model.step),
        fmt::format("the end, {} s, must be at most {:g} of them", options.end, kMostSteps));
  const std::vector<Part> parts = make_parts(model, options, problems);
  problems.finish();
  Draft draft = make_draft(model, parts, options, model.remarks);
  if (draft.scene.bodies.empty())
    problems.add(document.root().GetLineNum(), "", "", "has nothing that moves or touches");
  problems.finish();
  Imported out;
  for (const std::string& line : model.remarks.lines()) out.remarks.push_back(shown(line));
  out.toml = with_comments(write_scene(draft.scene), "body", draft.body_comments);
  out.toml = heading(model, file, draft, out.remarks) +
             with_comments(out.toml, "joint", draft.joint_comments);
  try {
    parse_scene(out.toml, "the scene");
  } catch (const SceneError& e) {
    problems.add(document.root().GetLineNum(), "", "",
                 "has numbers that no scene has: " + e.problems().front().message());
    problems.finish();
  }
  return out;
}

}  // namespace

Imported import_robot(std::string_view text, const std::string& file,
                      const ImportOptions& options) {
  try {
    return convert(text, file, options);
  } catch (const SceneError&) {
    throw;
  } catch (const std::invalid_argument&) {
    throw;
  } catch (const std::exception& e) {  // out of memory
    files::refuse({file}, std::string("cannot be read: ") + e.what());
  }
}

std::vector<std::string> Remarks::lines() const {
  std::vector<std::string> out;
  for (const Line& line : lines_) {
    std::vector<std::string> names = line.names;
    sort_unique(names);
    if (!names.empty())
      out.push_back(fmt::format("{}: {}{}", line.what, fmt::join(names, ", "),
                                line.names.size() < kMostListed ? "" : ", ..."));
    else
      out.push_back(line.count > 1 ? fmt::format("{} ({} times)", line.what, line.count)
                                   : line.what);
  }
  return out;
}

}  // namespace tether::scene::import
