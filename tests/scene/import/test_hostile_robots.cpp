// Tests: robot files of somebody who means harm: size, names and classes without end.
// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "import/import.hpp"
#include "support/catch.hpp"
#include "support/growth.hpp"

using namespace tether::scene;
using import::import_robot;
using tether::test::growth;
using tether::test::kLinear;

namespace {

import::Imported imported(const std::string& text){return import_robot(text, "robot.xml", {});
}

std::string refusal(const std::string& text) {
  try {
    imported(text);
  } catch (const SceneError& e) {
    return e.what();
  }
  return "taken";
}

std::string times(int count, const std::string& before, const std::string& behind) {
  std::string out;
  for (int k = 0; k < count; ++k) out += before + std::to_string(k) + behind;
  return out;
}

const std::string kMass =
    "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' "
    "iyz='0'/></inertial>";

using Catch::Matchers::Contains;

}  // namespace

TEST_CASE("an element of a robot file has at most 100 attributes, at once") {
  const auto robot = [](int attributes) {
    return "<robot name='r'\n" + times(attributes - 1, " a", "='<>'") + "><!-- " +
           times(200, " b", "='1'") + " --><link name='a'>" + kMass + "</link></robot>";
  };
  CHECK_THAT(refusal(robot(100)), !Contains("attributes"));
  CHECK_THAT(refusal(robot(101)), Contains("robot.xml:1: ") && Contains("at most 100 attributes"));
  // The parser compares each attribute with all others: a minute for these.
  CHECK_THAT(refusal(robot(200000)), Contains("at most 100 attributes"));
}

TEST_CASE("a robot file has at most 64 MiB") {
  const std::string robot =
      "<mujoco><worldbody><body name='b'><freejoint/><geom size='1'/></body>"
      "</worldbody></mujoco>";
  const std::size_t most = std::size_t{64} << 20;
  CHECK(refusal(robot + std::string(most - robot.size(), ' ')) == "taken");
  CHECK_THAT(refusal(robot + std::string(most - robot.size() + 1, ' ')),
             Contains("at most 64 MiB"));
  CHECK_THAT(refusal(std::string(most + 1, '<')), Contains("at most 64 MiB"));
}

// The limit is that of the XML library, 100 or, of later ones, 500.
TEST_CASE(
    "elements of a robot file inside each other are bounded before anything is made of them") {
  const auto deep = [](int depth) {
    std::string open, close;
    for (int k = 0; k < depth; ++k) open += "<a>", close += "</a>";
    return refusal("<robot name='r'><link name='l'>" + open + close + "</link></robot>");
  };
  CHECK_THAT(deep(90), !Contains("inside each other"));
  for (const int depth : {600, 2000000}) CHECK_THAT(deep(depth), Contains("inside each other"));
}

TEST_CASE("names in a robot file have at most 200 bytes, and are shown shortened") {
  const std::string name(201, 'n');
  for (const std::string& text :
       {"<robot><link name='" + name + "'/></robot>", "<robot><" + name + "/></robot>",
        "<robot><link name='a' " + name + "='1'/></robot>",
        "<mujoco><worldbody childclass='" + name + "'/></mujoco>"}) {
    const std::string said = refusal(text);
    CHECK_THAT(said, Contains("robot.xml:1") && Contains("at most 200 bytes"));
    CHECK(said.find(name) == std::string::npos);
  }
  const std::string title(5000, 't');  // of the scene: left out
  CHECK(refusal("<mujoco model='" + title +
                "'><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>") ==
        "taken");
}

// Each of these took a number of copies, or looks, that is the square of the file's length.
TEST_CASE("robot files of thousands of parts cost no more than their length") {
  // Classes inside a class that has much; 4 * 10^8 attributes.
  CHECK_THAT(refusal("<mujoco><default>" + times(20000, "<e", " a='1'/>") +
                     times(20000, "<default class='c", "'/>") + "</default><worldbody/></mujoco>"),
             Contains("at most 1000000 attributes"));
  CHECK_THAT(refusal("<mujoco><default><geom " + times(101, "a", "='1' ") +
                     "/></default><worldbody/></mujoco>"),
             Contains("at most 100 attributes"));

  // Links without mass in a row, whose joints all go to the last one.
  const auto chain = [](int links) {
    std::string text = "<robot name='r'>";
    for (int k = 0; k <= links; ++k)
      text += "<link name='l" + std::to_string(k) + "'>" + (k == links || k == 0 ? kMass : "") +
              "</link>\n";
    for (int k = 0; k < links; ++k)
      text += "<joint name='j" + std::to_string(k) + "' type='continuous'><parent link='l" +
              std::to_string(k) + "'/><child link='l" + std::to_string(k + 1) + "'/></joint>\n";
    const std::string in_a_row = imported(text + "</robot>").toml;
    const std::size_t first = in_a_row.find("name = \"j0\""),
                      last = in_a_row.find("name = \"j" + std::to_string(links - 1) + "\"");
    CHECK(first < last);
    CHECK(last != std::string::npos);
  };
  CHECK(growth(chain, 2000) < kLinear);

  // Links without mass below one.
  const auto fan = [](int links) {
    std::string text = "<robot name='r'><link name='l'>" + kMass + "</link><link name='m'>" +
                       kMass +
                       "</link><joint name='k' type='continuous'><parent link='l'/><child "
                       "link='m'/></joint>\n";
    for (int k = 0; k < links; ++k)
      text += "<link name='l" + std::to_string(k) + "'>" + (k % 2 != 0 ? kMass : "") +
              "</link><joint name='j" + std::to_string(k) +
              "' type='continuous'><parent link='m'/><child link='l" + std::to_string(k) +
              "'/></joint>\n";
    const import::Imported hanging = imported(text + "</robot>");
    CHECK(hanging.toml.find("name = \"l" + std::to_string(links - 1) + "\"") != std::string::npos);
    CHECK(hanging.toml.find("name = \"l" + std::to_string(links - 2) + "\"") == std::string::npos);
  };
  CHECK(growth(fan, 2000) < kLinear);

  // Things of the world of one name.
  const auto same = [](int things) {
    std::string text = "<mujoco><worldbody><body name='b'><freejoint/><geom size='1'/></body>";
    for (int k = 0; k < things; ++k) text += "<geom name='g' size='1'/>";
    CHECK(imported(text + "</worldbody></mujoco>")
              .toml.find("\"g " + std::to_string(things) + "\"") != std::string::npos);
  };
  CHECK(growth(same, 2000) < kLinear);
}
