// Tether: links and joints of a URDF as a tree. SPDX-License-Identifier: BSD-3-Clause
#include "tree.hpp"

#include <fmt/format.h>

#include <map>

namespace tether::scene::import {

namespace {

struct Tree {
  std::vector<const UrdfJoint*> carrier;   // of each link; null: a root
  std::vector<std::vector<int>> children;  // of each link
};

std::map<std::string, int> names_of(const std::vector<Link>& links, Problems& problems) {
  std::map<std::string, int> out;
  for (std::size_t k = 0; k < links.size(); ++k)
    if (!out.emplace(links[k].name, static_cast<int>(k)).second)
      problems.add(links[k].line, fmt::format("link \"{}\": name", links[k].name), "",
                   "another link has it already");
  return out;
}

Tree tree_of(const std::vector<Link>& links, const std::vector<UrdfJoint>& joints,
             Problems& problems) {
  const std::map<std::string, int> index = names_of(links, problems);
  Tree out{std::vector<const UrdfJoint*>(links.size(), nullptr),
           std::vector<std::vector<int>>(links.size())};
  std::map<std::string, int> names;
  for (const UrdfJoint& joint : joints) {
    const std::string path = fmt::format("joint \"{}\": ", joint.name);
    if (!names.emplace(joint.name, 0).second)
      problems.add(joint.line, path + "name", "", "another joint has it already");
    const auto parent = index.find(joint.parent), child = index.find(joint.child);
    if (parent == index.end())
      problems.add(joint.line, path + "parent", fmt::format("\"{}\"", joint.parent),
                   "there is no such link");
    if (child == index.end())
      problems.add(joint.line, path + "child", fmt::format("\"{}\"", joint.child),
                   "there is no such link");
    if (parent == index.end() || child == index.end()) continue;
    const UrdfJoint*& carrier = out.carrier[static_cast<std::size_t>(child->second)];
    if (carrier != nullptr) {
      problems.add(
          joint.line, path + "child", fmt::format("\"{}\"", joint.child),
          fmt::format("hangs on joint \"{}\" already; closed loops are no URDF", carrier->name));
      continue;
    }
    carrier = &joint;
    out.children[static_cast<std::size_t>(parent->second)].push_back(child->second);
  }
  return out;
}

}  // namespace

std::vector<Link> in_tree_order(std::vector<Link> links, const std::vector<UrdfJoint>& joints,
                                Problems& problems) {
  const Tree tree = tree_of(links, joints, problems);
  if (!problems.clean()) return {};
  std::vector<int> order, place(links.size(), -1);
  for (std::size_t k = 0; k < links.size(); ++k)
    if (tree.carrier[k] == nullptr) {
      if (!order.empty())
        problems.add(links[k].line, fmt::format("link \"{}\"", links[k].name), "",
                     fmt::format("no joint carries it, as none carries \"{}\": one link is the "
                                 "base",
                                 links[static_cast<std::size_t>(order[0])].name));
      order.push_back(static_cast<int>(k));
    }
  for (std::size_t next = 0; next < order.size(); ++next)
    for (const int child : tree.children[static_cast<std::size_t>(order[next])])
      order.push_back(child);
  for (std::size_t k = 0; k < order.size(); ++k)
    place[static_cast<std::size_t>(order[k])] = static_cast<int>(k);
  for (std::size_t k = 0; k < links.size(); ++k)
    if (place[k] < 0) {
      problems.add(links[k].line, fmt::format("link \"{}\"", links[k].name), "",
                   "is in a loop of joints: a URDF is a tree");
      break;
    }
  if (!problems.clean()) return {};
  std::vector<Link> out;
  const std::map<std::string, int> index = names_of(links, problems);
  for (const int k : order) {
    Link link = std::move(links[static_cast<std::size_t>(k)]);
    if (const UrdfJoint* joint = tree.carrier[static_cast<std::size_t>(k)]) {
      link.parent = place[static_cast<std::size_t>(index.at(joint->parent))];
      link.pose = joint->pose;
      link.joints = joint->joints;
    }
    out.push_back(std::move(link));
  }
  return out;
}

}  // namespace tether::scene::import
