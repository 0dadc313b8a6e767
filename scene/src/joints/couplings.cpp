// Tether: couplings of joints: gears, racks, screws, differentials. SPDX-License-Identifier:
// BSD-3-Clause
//
//   sum of weight s = 0   or   s_1 = p(s_2)
//
// s is the angle or way of a hinge or slider, which is 0 at t = 0: a row (Relation) as those of
// joints, whose multiplier acts along each s.
#include "joint_rows.hpp"

#include <numeric>
#include <tether/linalg/pi.hpp>

#include "joint_type.hpp"
#include "mechanics/effect.hpp"

namespace tether::scene {

namespace couplings {

using mechanics::at;

namespace {

constexpr long kMostTeeth = 1000;

struct Fraction {
  long over = 0, under = 0;  // 0: none
};

// By a continued fraction.
Fraction fraction(double ratio) {
  long over[2] = {1, 0}, under[2] = {0, 1};
  double rest = std::abs(ratio);
  for (int k = 0; k < 40 && rest < 1e9; ++k) {
    const long whole = std::lround(std::floor(rest));
    const long p = whole * over[0] + over[1], q = whole * under[0] + under[1];
    if (p > kMostTeeth * kMostTeeth || q > kMostTeeth) break;
    if (std::abs(static_cast<double>(p) / static_cast<double>(q) - std::abs(ratio)) <=
        kSameFigure * std::abs(ratio))
      return {ratio < 0 ? -p : p, q};
    over[1] = std::exchange(over[0], p);
    under[1] = std::exchange(under[0], q);
    rest = 1 / (rest - static_cast<double>(whole));
  }
  return {};
}

// f(its polynomial, the weight of the first angle) of each angle but the first; false where one of
// them is no polynomial of degree 1.
template <class Parts, class F>
double with_angles(const Scene& scene, const Coupling& coupling, Parts& parts, const F& f) {
  double first = 0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (!joints::is_angle(scene.joints[at(coupling.joints[k])])) continue;
    if (parts[k].size() > 1) return 0;
    if (first == 0)
      first = parts[k][0];
    else
      f(parts[k][0], first);
  }
  return first;
}

}  // namespace

std::vector<std::vector<double>> polynomials(const Scene& scene, const Coupling& coupling) {
  const auto refuse = [&](const std::string& what) {
    throw std::invalid_argument("coupling \"" + coupling.name + "\": " + what);
  };
  const std::size_t n = coupling.joints.size();
  if (n < 2) refuse("it has fewer than two joints");
  for (const int j : coupling.joints) {
    if (j < 0 || at(j) >= scene.joints.size()) refuse("it has a joint that is not there");
    if (!joints::type(scene.joints[at(j)].kind).is_free())
      refuse("joint \"" + joints::name_of(scene.joints[at(j)], at(j)) +
             "\" is no hinge and no slider");
    if (std::count(coupling.joints.begin(), coupling.joints.end(), j) > 1)
      refuse("joint \"" + joints::name_of(scene.joints[at(j)], at(j)) + "\" is there twice");
  }
  std::vector<std::vector<double>> out;
  if (coupling.polynomial.empty()) {
    if (coupling.weights.size() != n) refuse("it needs a weight for each joint");
    for (const double w : coupling.weights) out.push_back({w});
  } else {
    if (n != 2 || !coupling.weights.empty())
      refuse("a polynomial is of two joints, and without weights");
    out.push_back({1});
    out.push_back(coupling.polynomial);
    for (double& c : out.back()) c = -c;
    while (out.back().size() > 1 && out.back().back() == 0) out.back().pop_back();
  }
  for (const std::vector<double>& part : out) {
    if (part.size() == 1 && part[0] == 0) refuse("a weight is 0");
    for (const double c : part)
      if (!std::isfinite(c)) refuse("its numbers must be finite");
  }
  with_angles(scene, coupling, out, [](double& weight, double first) {
    const Fraction f = fraction(weight / first);
    if (f.under > 0) weight = first * static_cast<double>(f.over) / static_cast<double>(f.under);
  });
  return out;
}

double turn(const Scene& scene, const Coupling& coupling,
            const std::vector<std::vector<double>>& parts) {
  long under = 1;
  const double first = with_angles(scene, coupling, parts, [&](double weight, double of) {
    const Fraction f = fraction(weight / of);
    under = f.under == 0 || under == 0 ? 0 : std::lcm(under, f.under);
    if (under > kMostTeeth) under = 0;
  });
  return under == 0 ? 0 : 2 * linalg::kPi * std::abs(first) / static_cast<double>(under);
}

}  // namespace couplings

namespace effects {

namespace {

struct CouplingEffect : Effect {
  void fields(const Form& root, Scene& scene) const override {
    root.each("coupling", scene.couplings, [&](const Form& form, Coupling& coupling) {
      form.name("coupling", coupling.name);
      if (form.in()) return read_terms(*form.in(), *form.reader(), coupling);
      if (form.out()) write_terms(scene, coupling, *form.out());
      if (form.units()) convert(scene, *form.units(), coupling);
      return true;
    });
  }
  void check(const Scene& scene, Report& report) const override {
    std::set<std::string> names;
    for (const Coupling& coupling : scene.couplings) {
      check_name(coupling, "coupling", names, report);
      try {
        couplings::polynomials(scene, coupling);
      } catch (const std::invalid_argument& e) {
        report.add(coupling.place, "", "", e.what());
      }
    }
  }
  void plan(const Scene& scene, EngineKind, Lines& lines) const override {
    add_count(lines, "couplings", scene.couplings.size(), "coupling", " of joints");
  }
  void limit_momenta(Momenta& momenta) const override {
    for (const Coupling& coupling : momenta.scene.couplings)
      for (const int j : coupling.joints) {
        const Joint& joint = momenta.scene.joints[at(j)];
        if (momenta.holds_outside(joint.first, joint.second))
          momenta.axes.none("coupling \"" + coupling.name + "\" holds from outside");
      }
  }

 private:
  static bool read_terms(Fields& in, Reader& r, Coupling& coupling) {
    const std::map<std::string, int> joints = index_of(r.scene.joints);
    for (const std::string& name :
         r.names(in, "joints", 2, std::string::npos, "an array of two names of joints or more",
                 "there is no joint", joints))
      coupling.joints.push_back(joints.at(name));
    const std::size_t n = std::max<std::size_t>(2, coupling.joints.size());
    if (in.has("weights")) coupling.weights = in.numbers("weights", {n}, "");
    if (const Value* list = in.find("polynomial"); list != nullptr) {
      const std::size_t terms = list->kind() == Value::Kind::array ? list->items().size() : 0;
      coupling.polynomial = in.numbers("polynomial", {std::clamp<std::size_t>(terms, 1, 16)}, "");
    }
    if (in.has("ratio")) coupling.polynomial = {in.number("ratio", 1, kAny, "")};
    if (in.has("ratio") + in.has("weights") + in.has("polynomial") != 1)
      in.missing("ratio", "give ratio (of two joints), weights or polynomial, one of the three");
    return !coupling.joints.empty();
  }
  static void write_terms(const Scene& scene, const Coupling& coupling, Writer& out) {
    std::vector<std::string> joints;
    for (const int j : coupling.joints) joints.push_back(scene.joints[at(j)].name);
    out.field("joints", joints);
    if (coupling.polynomial.empty())
      out.field("weights", coupling.weights);
    else
      out.field("polynomial", coupling.polynomial);
  }
  // In units of the first coordinate.
  static void convert(const Scene& scene, const Units& units, Coupling& coupling) {
    const auto unit = [&](std::size_t k) {
      return joints::is_angle(scene.joints[at(coupling.joints[k])]) ? 1 : units.length;
    };
    for (std::size_t k = 0; k < coupling.weights.size(); ++k)
      coupling.weights[k] *= unit(k) / unit(0);
    double factor = 1 / unit(0);
    for (double& c : coupling.polynomial) c *= factor *= unit(1);
  }
};

}  // namespace

TETHER_EFFECT(couplings, CouplingEffect)

}  // namespace effects

}  // namespace tether::scene
