// Tether: the problems of the comparison. SPDX-License-Identifier: BSD-3-Clause
#include "catalogue.hpp"

#include <algorithm>
#include <problems/akzo_nobel.hpp>
#include <problems/andrews.hpp>
#include <problems/bricard.hpp>
#include <problems/car_axis.hpp>
#include <problems/charge_pump.hpp>
#include <problems/fekete.hpp>
#include <problems/governor.hpp>
#include <problems/kepler.hpp>
#include <problems/linear_masses.hpp>
#include <problems/link_chain.hpp>
#include <problems/lotka_volterra.hpp>
#include <problems/nand_gate.hpp>
#include <problems/oregonator.hpp>
#include <problems/pendulum.hpp>
#include <problems/pinned_rods.hpp>
#include <problems/rigid_body.hpp>
#include <problems/robertson.hpp>
#include <problems/slider_crank.hpp>
#include <problems/transistor_amplifier.hpp>
#include <problems/two_bit_adder.hpp>
#include <problems/water_tube.hpp>
#include <problems/wheelset.hpp>
#include <stdexcept>

namespace tether::bench {

namespace {

template <class Make>
std::vector<problems::Problem> in_forms(const std::vector<std::string>& names, Make make) {
  std::vector<problems::Problem> forms;
  for (const std::string& name : names) forms.push_back(make(name));
  return forms;
}

}  // namespace

std::vector<Case> catalogue() {
  using namespace problems;
  const double g = 9.81;
  return {
      {"pendulum", "t = 10, four swings, energy kept",
       in_forms(pendulum_forms(), [&](auto& form) { return pendulum(1, g, 10, form); })},
      {"long pendulum", "t = 100, 42 swings: errors of phase add up",
       in_forms(pendulum_forms(), [&](auto& form) { return pendulum(1, g, 100, form); })},
      {"car axis", "constraints move with the road; nothing else is kept",
       in_forms(car_axis_forms(), [](auto& form) { return car_axis(form); })},
      {"andrews", "seven bodies, large accelerations, energy with a motor's work",
       in_forms(andrews_forms(), [](auto& form) { return andrews(form); })},
      {"slider crank", "stiff, weakly excited elastic modes without damping",
       in_forms(slider_crank_forms(), [](auto& form) { return slider_crank(form); })},
      {"robertson", "chemistry over six decades of rates; mass kept",
       in_forms(robertson_forms(), [](auto& form) { return robertson(40.0, form); })},
      {"transistor amplifier", "singular constant mass matrix", {transistor_amplifier()}},
      {"akzo nobel", "chemistry with one equilibrium", {akzo_nobel()}},
      {"rigid body",
       "free rotation: quaternion, energy, angular momentum",
       {rigid_body("dzhanibekov", 100.0)}},
      {"kepler", "eccentricity 0.6, t = 100: four invariants of rank three", {kepler(0.6, 100.0)}},
      {"lotka volterra", "one invariant that is no polynomial", {lotka_volterra(2, 0.5, 100)}},
      {"four bar", "two linked four-bars: rank drops twice a turn",
       in_forms(pinned_rods_forms(), [](auto& form) { return n_four_bar(2, 10.0, form); })},
      {"four bar of 5", "five linked four-bars, t = 3: rank drops by five",
       in_forms(pinned_rods_forms(), [](auto& form) { return n_four_bar(5, 3.0, form); })},
      {"four bar of 10", "ten linked four-bars, t = 1: rank drops by ten",
       in_forms(pinned_rods_forms(), [](auto& form) { return n_four_bar(10, 1.0, form); })},
      {"bricard", "six-bar linkage in space, one row redundant throughout",
       in_forms(bricard_forms(), [](auto& form) { return bricard(5.0, form); })},
      {"governor", "stiff dampers; angular momentum kept, energy not",
       in_forms(governor_forms(), [](auto& form) { return governor(1.0, form); })},
      {"five-link chain", "chaotic: falls from the horizontal, t = 2",
       in_forms(pinned_rods_forms(), [](auto& form) { return five_link_chain(2.0, form); })},
      {"chain of 100",
       "hundred links falling, t = 0.5: sparse factors (KLU)",
       {link_chain(100, 0.5)}},
  };
}

std::vector<Case> dae_set() {
  using namespace problems;
  return {
      {"andrews", "squeezer of seven bodies",
       in_forms({"index 3 w", "index 2", "index 1"}, [](auto& form) { return andrews(form); })},
      {"car axis", "rheonomic, slightly stiff",
       in_forms({"index 3", "GGL", "index 1"}, [](auto& form) { return car_axis(form); })},
      {"slider crank", "stiff elastic modes without damping",
       in_forms({"index 2", "index 1"}, [](auto& form) { return slider_crank(form); })},
      {"fekete", "twenty points on a sphere come to rest",
       in_forms({"GGL", "index 1"}, [](auto& form) { return fekete(form); })},
      {"wheelset", "contact of wheel and rail, friction", {wheelset()}},
      {"linear masses", "a rigid link, a force that jumps",
       in_forms({"index 3", "index 2", "index 1"}, [](auto& form) { return linear_masses(form); })},
      {"charge pump", "forty kinks of the voltage, index 2", {charge_pump()}},
      {"water tube", "18 pipes, laminar and turbulent", {water_tube()}},
      {"transistor amplifier", "singular constant mass matrix", {transistor_amplifier()}},
      {"nand gate", "three transistors, kinks of the inputs",
       in_forms(nand_gate_forms(), [](auto& form) { return nand_gate(form); })},
      {"two-bit adder", "350 unknowns, kinks of the inputs", {two_bit_adder()}},
      {"robertson", "chemistry over six decades of rates",
       in_forms(robertson_forms(), [](auto& form) { return robertson(40.0, form); })},
      {"akzo nobel", "chemistry with one equilibrium", {akzo_nobel()}},
      {"oregonator", "an ordinary differential equation that keeps nothing", {oregonator()}},
  };
}

std::vector<Case> selected(std::vector<Case> cases, const std::vector<std::string>& only,
                           const std::vector<std::string>& skip) {
  const auto has = [](const Case& which, std::string name) {
    std::replace(name.begin(), name.end(), '_', ' ');
    return which.name.find(name) != std::string::npos;
  };
  const auto any = [&](const Case& which, const std::vector<std::string>& names) {
    return std::any_of(names.begin(), names.end(),
                       [&](const std::string& name) { return has(which, name); });
  };
  std::vector<Case> wanted;
  for (const std::string& name : only)
    if (std::none_of(cases.begin(), cases.end(), [&](const Case& c) { return has(c, name); }))
      throw std::invalid_argument("--problem: no problem's name contains \"" + name + "\"");
  for (Case& which : cases)
    if ((only.empty() || any(which, only)) && !any(which, skip)) wanted.push_back(std::move(which));
  return wanted;
}

}  // namespace tether::bench
