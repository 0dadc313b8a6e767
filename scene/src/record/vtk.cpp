// Tether: a run for ParaView: a .pvd of the times, a .vtp of the bodies and one of the contacts for
// each. SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "geometry/mesh.hpp"
#include "output/output_names.hpp"
#include "output/whole_file.hpp"
#include "record/number_at.hpp"
#include "recorder.hpp"

namespace tether::scene {

namespace {

using Eigen::Vector3d;

/// Beyond it spheres are points with a radius (filter "Glyph"), not surfaces.
constexpr std::size_t kMostSurfaces = 1000;
constexpr int kAround = 24;

/// Binary arrays behind the XML, each with its length in front.
class Appended {
 public:
  template <class T>
  std::size_t add(const std::vector<T>& values) {
    const std::size_t offset = bytes_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof length);
    append(values.data(), length);
    return offset;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t length) {
    if (length > 0) bytes_.append(static_cast<const char*>(data), length);
  }
  std::string bytes_;
};

/// One .vtp file: points, then single points and polygons on them, then data of the points.
class PolyData {
 public:
  std::vector<float> points;
  std::vector<std::int32_t> vertices, polygons, ends;  // `ends`: of each polygon in `polygons`

  void scalars(const char* name, const std::vector<float>& values) { data(name, values, 1); }
  void vectors(const char* name, const std::vector<float>& values) { data(name, values, 3); }

  void write(const std::string& file) {
    std::vector<std::int32_t> each(vertices.size());
    for (std::size_t i = 0; i < each.size(); ++i) each[i] = static_cast<std::int32_t>(i + 1);
    std::string xml = fmt::format(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<Piece "
        "NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
        "NumberOfPolys=\"{}\">\n",
        points.size() / 3, vertices.size(), ends.size());
    xml += "<PointData>\n" + data_ + "</PointData>\n<Points>\n" +
           array("Float32", "Points", 3, appended_.add(points)) + "</Points>\n<Verts>\n" +
           array("Int32", "connectivity", 1, appended_.add(vertices)) +
           array("Int32", "offsets", 1, appended_.add(each)) + "</Verts>\n<Polys>\n" +
           array("Int32", "connectivity", 1, appended_.add(polygons)) +
           array("Int32", "offsets", 1, appended_.add(ends)) +
           "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    write_fresh(file, xml + appended_.bytes() + "\n</AppendedData>\n</VTKFile>\n");
  }

 private:
  static std::string array(const char* type, const char* name, int components, std::size_t offset) {
    return fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" "
        "offset=\"{}\"/>\n",
        type, name, components, offset);
  }
  void data(const char* name, const std::vector<float>& values, int components) {
    data_ += array("Float32", name, components, appended_.add(values));
  }
  std::string data_;
  Appended appended_;
};

void put(std::vector<float>& out, const Vector3d& v) {
  for (int i = 0; i < 3; ++i) out.push_back(static_cast<float>(v[i]));
}

class VtkRecorder : public Recorder {
 public:
  VtkRecorder(const Scene& scene, const std::string& file, const Resume& resume)
      : file_(film_file(file)), folder_(film_folder(file)), forces_(scene.output.forces) {
    if (resume.restarted) keep_up_to(resume.time);
    make_folder_of(folder_ + "/x");
    check_writable(file_);
    std::size_t surfaces = 0;
    for (const Body& body : scene.bodies) surfaces += body.shapes.size();
    const double half_plane = 2 * extent(scene);
    for (const Body& body : scene.bodies) {
      meshes_.emplace_back();
      for (const Shape& shape : body.shapes) {
        const bool as_point = shape.kind == ShapeKind::sphere && surfaces > kMostSurfaces;
        meshes_.back().push_back(as_point ? Part{{{shape.position}, {}, {0}}, shape.radius}
                                          : Part{mesh(shape, kAround, half_plane), 0});
      }
    }
  }

  void record(const Engine& engine, const Diagnostics&) override {
    add("bodies", 0, engine.time(), bodies(engine));
    if (!engine.contacts().empty())
      add("contacts", 1, engine.time(), contacts(engine));
    else
      remove_frame("contacts");
    if (forces_) {
      const Forces forces = engine.forces();
      if (!forces.joints.empty()) add("joints", 2, engine.time(), joints(forces));
      if (!forces.springs.empty()) add("springs", 3, engine.time(), springs(forces));
    }
    ++number_;
  }

  void keep(const Engine&) override { write_film(); }

  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    write_film();
    written.push_back(file_);
  }

 private:
  struct Part {
    Mesh mesh;
    double radius;
  };

  void write_film() {
    write_whole(file_,
                "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" "
                "byte_order=\"LittleEndian\">\n<Collection>\n" +
                    sets_ + "</Collection>\n</VTKFile>\n");
  }

  static double extent(const Scene& scene) {
    double half = 1;
    for (const Body& body : scene.bodies) half = std::max(half, body.position.norm());
    return half;
  }

  void add(const char* what, int part, double time, PolyData data) {
    const std::string name = fmt::format("{}/{}_{:06}.vtp", folder_, what, number_);
    data.write(name);
    sets_ += fmt::format("<DataSet timestep=\"{}\" part=\"{}\" file=\"{}/{}_{:06}.vtp\"/>\n", time,
                         part, std::filesystem::path(folder_).filename().string(), what, number_);
  }

  // That of an earlier run, of which this one takes the names.
  void remove_frame(const char* what) const {
    std::error_code ignored;
    std::filesystem::remove(fmt::format("{}/{}_{:06}.vtp", folder_, what, number_), ignored);
  }

  PolyData bodies(const Engine& engine) const {
    PolyData out;
    std::vector<float> index, radius, velocity, spin;
    for (std::size_t b = 0; b < meshes_.size(); ++b) {
      const BodyState& state = engine.bodies()[b];
      const Eigen::Matrix3d R = state.orientation.toRotationMatrix();
      for (const Part& part : meshes_[b]) {
        const auto first = static_cast<std::int32_t>(out.points.size() / 3);
        for (const Vector3d& p : part.mesh.points) {
          const Vector3d arm = R * p;
          put(out.points, state.position + arm);
          put(velocity, state.velocity + state.angular_velocity.cross(arm));
          put(spin, state.angular_velocity);
          index.push_back(static_cast<float>(b));
          radius.push_back(static_cast<float>(part.radius));
        }
        for (const std::size_t k : part.mesh.single)
          out.vertices.push_back(first + static_cast<std::int32_t>(k));
        for (const std::vector<std::size_t>& face : part.mesh.faces) {
          for (const std::size_t k : face)
            out.polygons.push_back(first + static_cast<std::int32_t>(k));
          out.ends.push_back(static_cast<std::int32_t>(out.polygons.size()));
        }
      }
    }
    out.scalars("body", index);
    out.scalars("radius", radius);
    out.vectors("velocity", velocity);
    out.vectors("angular_velocity", spin);
    return out;
  }

  PolyData contacts(const Engine& engine) const {
    PolyData out;
    std::vector<float> impulse, normal, gap, force, slip;
    for (const ContactState& c : engine.contacts()) {
      out.vertices.push_back(static_cast<std::int32_t>(out.vertices.size()));
      put(out.points, c.point);
      put(impulse, c.impulse);
      put(normal, c.normal);
      gap.push_back(static_cast<float>(c.gap));
      put(force, c.force);
      put(slip, c.slip);
    }
    out.vectors("impulse", impulse);
    out.vectors("normal", normal);
    out.scalars("gap", gap);
    if (!forces_) return out;
    out.vectors("force", force);
    out.vectors("slip", slip);
    return out;
  }

  static PolyData joints(const Forces& forces) {
    PolyData out;
    std::vector<float> force, moment, drive;
    for (const JointForce& each : forces.joints) {
      out.vertices.push_back(static_cast<std::int32_t>(out.vertices.size()));
      put(out.points, each.at);
      put(force, each.force);
      put(moment, each.moment);
      drive.push_back(static_cast<float>(each.drive));
    }
    out.vectors("force", force);
    out.vectors("moment", moment);
    out.scalars("drive", drive);
    return out;
  }

  // In the middle between its ends.
  static PolyData springs(const Forces& forces) {
    PolyData out;
    std::vector<float> tension;
    for (const SpringForce& each : forces.springs) {
      out.vertices.push_back(static_cast<std::int32_t>(out.vertices.size()));
      put(out.points, 0.5 * (each.at + each.at_second));
      tension.push_back(static_cast<float>(each.tension));
    }
    out.scalars("tension", tension);
    return out;
  }

  /// Takes over the frames of an earlier run, so that both make one film.
  void keep_up_to(double time) {
    std::ifstream in(file_, std::ios::binary);
    std::string line;
    while (std::getline(in, line)) {
      const std::string start = "<DataSet timestep=\"";
      if (line.compare(0, start.size(), start) != 0) continue;
      if (!(number_at(line, start.size()) <= time)) break;
      sets_ += line + '\n';
      // Lines of another hand name no frame that this run could have written.
      const std::size_t number = line.rfind('_');
      if (number == std::string::npos) continue;
      long last = 0;
      std::from_chars(line.data() + number + 1, line.data() + line.size(), last);
      if (last >= number_ && last < static_cast<long>(kMostRecords)) number_ = last + 1;
    }
  }

  std::string file_, folder_, sets_;
  bool forces_;
  long number_ = 0;
  std::vector<std::vector<Part>> meshes_;
};

}  // namespace

std::unique_ptr<Recorder> make_vtk_recorder(const Scene& scene, const std::string& file,
                                            const Resume& resume) {
  return std::make_unique<VtkRecorder>(scene, file, resume);
}

}  // namespace tether::scene
