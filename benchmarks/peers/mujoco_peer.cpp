// MuJoCo in the comparison. SPDX-License-Identifier: BSD-3-Clause
#include <mujoco/mujoco.h>

#include <iomanip>
#include <sstream>

#include "peer.hpp"

namespace {

std::ostream& operator<<(std::ostream& out, const Eigen::Vector3d& v) {
  return out << v.transpose();
}
std::string quoted(const Eigen::Vector3d& v) {
  std::ostringstream out;
  out << std::setprecision(17) << '"' << v << '"';
  return out.str();
}
std::string quoted(const Eigen::Quaterniond& q) {
  std::ostringstream out;
  out << std::setprecision(17) << '"' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z()
      << '"';
  return out.str();
}

class MuJoCo {
 public:
  MuJoCo(const peers::Scene& scene, const std::string& setting, double value)
      : scene_(scene), value_(value) {
    const double h = scene.end / (peers::kSamples * value);
    mju_user_warning = [](const char*) {};  // it would write a file; the table tells what came out
    std::ostringstream xml;
    xml << std::setprecision(17)
        << "<mujoco><compiler angle=\"radian\" boundmass=\"0\" balanceinertia=\"false\"/>"
        << "<option timestep=\"" << h << "\" gravity=" << quoted(scene.gravity);
    const std::size_t comma = setting.find(',');
    if (setting != "defaults")
      xml << " integrator=\"" << setting.substr(0, comma)
          << "\" cone=\"elliptic\" impratio=\"100\" tolerance=\"0\" iterations=\"100\"";
    xml << "/><worldbody>";
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      if (parent(i) < 0) write(xml, i);
    xml << "</worldbody>";
    laws(xml, setting == "defaults" ? 0 : std::atoi(setting.c_str() + comma + 1) * h);
    xml << "</mujoco>";
    load(xml.str());
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) start(i);
  }
  ~MuJoCo() {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }
  void advance(double) {
    peers::advance_in_steps(scene_, value_, [this](double) { mj_step(model_, data_); });
  }
  peers::Pose pose(int i) const {
    mj_kinematics(model_, data_);
    const int id = mj_name2id(model_, mjOBJ_BODY, ("b" + std::to_string(i)).c_str());
    const mjtNum *x = data_->xpos + 3 * id, *q = data_->xquat + 4 * id;
    return {{x[0], x[1], x[2]}, {q[0], q[1], q[2], q[3]}};
  }

 private:
  int parent(std::size_t i) const {
    const int j = scene_.bodies[i].joint;
    return j < 0 ? -1 : scene_.joints[j].second;
  }
  void write(std::ostream& xml, std::size_t i) const {
    const peers::Body& b = scene_.bodies[i];
    const int p = parent(i);
    const Eigen::Quaterniond frame =
        p < 0 ? Eigen::Quaterniond::Identity() : scene_.bodies[p].q.conjugate();
    const Eigen::Vector3d x = p < 0 ? b.x : Eigen::Vector3d(frame * (b.x - scene_.bodies[p].x));
    xml << "<body name=\"b" << i << "\" pos=" << quoted(x) << " quat=" << quoted(frame * b.q)
        << ">";
    if (!b.fixed) {
      xml << "<inertial pos=\"0 0 0\" mass=\"" << b.mass << "\" diaginertia=" << quoted(b.inertia)
          << "/>";
      if (b.joint < 0) {
        xml << "<freejoint name=\"j" << i << "\"/>";
      } else {
        const peers::Joint& j = scene_.joints[b.joint];
        xml << "<joint name=\"j" << i << "\" type=\"" << (j.kind == "slider" ? "slide" : j.kind)
            << "\" pos=" << quoted(b.q.conjugate() * (j.at - b.x))
            << " axis=" << quoted(b.q.conjugate() * j.axis) << "/>";
      }
    }
    for (std::size_t k = 0; k < b.shapes.size(); ++k) {
      const peers::Shape& s = b.shapes[k];
      xml << "<geom name=\"g" << i << '_' << k << "\" contype=\"0\" conaffinity=\"0\" type=\""
          << s.kind << "\" pos=" << quoted(s.at);
      if (s.kind == "plane") xml << " size=\"0 0 1\" zaxis=" << quoted(s.normal);
      if (s.kind == "sphere") xml << " size=\"" << s.radius << "\"";
      if (s.kind == "box") xml << " size=" << quoted(s.size / 2);
      xml << "/>";
    }
    for (std::size_t c = 0; c < scene_.bodies.size(); ++c)
      if (parent(c) == static_cast<int>(i)) write(xml, c);
    xml << "</body>";
  }
  /// Damping ratio of a spring and damper that end pulling nothing, for a restitution (T. Schwager,
  /// T. Poeschel, 2007, "Coefficient of restitution and linear-dashpot model revisited"); critical
  /// without one.
  static double damping_ratio(double e) {
    double low = 0, high = 1;
    for (int i = 0; e > 0 && i < 60; ++i) {
      const double z = (low + high) / 2, w = std::sqrt(1 - z * z);
      (std::exp(-z / w * std::atan2(2 * z * w, 2 * z * z - 1)) > e ? low : high) = z;
    }
    return high;
  }
  /// Contacts are springs with dampers, of the period 2 pi `contact_time` without damping; loops
  /// are closed likewise. 0: MuJoCo's defaults.
  void laws(std::ostream& xml, double contact_time) const {
    const auto stiffness = [&](double e) {
      std::ostringstream out;
      if (contact_time == 0) return std::string();
      out << std::setprecision(17) << " solref=\"" << -1 / (contact_time * contact_time) << ' '
          << -std::max(2 * damping_ratio(e) / contact_time, 1e-12)
          << "\" solimp=\"0.9999 0.9999 0.001\"";
      return out.str();
    };
    xml << "<contact>";
    for (std::size_t a = 0; a < scene_.bodies.size(); ++a)
      for (std::size_t b = a + 1; b < scene_.bodies.size(); ++b)
        if (const peers::Law* law = scene_.law(static_cast<int>(a), static_cast<int>(b)))
          for (std::size_t k = 0; k < scene_.bodies[a].shapes.size(); ++k)
            for (std::size_t l = 0; l < scene_.bodies[b].shapes.size(); ++l)
              xml << "<pair geom1=\"g" << a << '_' << k << "\" geom2=\"g" << b << '_' << l
                  << "\" condim=\"" << (law->friction > 0 ? 3 : 1) << "\" friction=\""
                  << law->friction << ' ' << law->friction << " 0 0 0\""
                  << stiffness(law->restitution) << "/>";
    xml << "</contact><equality>";
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      const peers::Joint& joint = scene_.joints[j];
      const peers::Body& body = scene_.bodies[joint.first];
      if (body.joint == static_cast<int>(j)) continue;
      if (joint.kind != "ball") throw std::invalid_argument("loops are closed by balls");
      xml << "<connect body1=\"b" << joint.first << "\" body2=\"b" << joint.second
          << "\" anchor=" << quoted(body.q.conjugate() * (joint.at - body.x)) << stiffness(0)
          << "/>";
    }
    xml << "</equality>";
  }
  void load(const std::string& xml) {
    mjVFS files;
    mj_defaultVFS(&files);
    mj_makeEmptyFileVFS(&files, "scene.xml", static_cast<int>(xml.size()));
    std::copy(xml.begin(), xml.end(), static_cast<char*>(files.filedata[0]));
    char error[500] = "";
    model_ = mj_loadXML("scene.xml", &files, error, sizeof(error));
    mj_deleteVFS(&files);
    if (!model_) throw std::runtime_error(error);
    data_ = mj_makeData(model_);
  }
  void start(std::size_t i) {
    const peers::Body& b = scene_.bodies[i];
    if (b.fixed) return;
    mjtNum* u =
        data_->qvel +
        model_->jnt_dofadr[mj_name2id(model_, mjOBJ_JOINT, ("j" + std::to_string(i)).c_str())];
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    const Eigen::Vector3d turn = b.w - (parent(i) < 0 ? none : scene_.bodies[parent(i)].w),
                          local = b.q.conjugate() * turn;
    const std::string kind = b.joint < 0 ? "free" : scene_.joints[b.joint].kind;
    if (kind == "hinge") *u = scene_.joints[b.joint].axis.dot(turn);
    if (kind == "slider")
      *u = scene_.joints[b.joint].axis.dot(b.v -
                                           (parent(i) < 0 ? none : scene_.bodies[parent(i)].v));
    if (kind == "free") std::copy(b.v.data(), b.v.data() + 3, u), u += 3;
    if (kind == "free" || kind == "ball") std::copy(local.data(), local.data() + 3, u);
  }

  const peers::Scene& scene_;
  double value_;
  mjModel* model_ = nullptr;
  mjData* data_ = nullptr;
};

}  // namespace

int main(int argc, char** argv) { return peers::main<MuJoCo>(argc, argv); }
