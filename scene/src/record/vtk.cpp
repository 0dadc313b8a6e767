// Tether: a run for ParaView: a .pvd of the times, a .vtp of the bodies and one of the contacts for
// each; of several processes a .pvtp that joins a .vtp of each. SPDX-License-Identifier:
// BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "formats.hpp"
#include "geometry/shape_type.hpp"
#include "output/files.hpp"

namespace tether::scene::formats {

namespace {

std::string declaration(const char* name, int components) {
  return fmt::format("<PDataArray type=\"Float32\" Name=\"{}\" NumberOfComponents=\"{}\"/>\n", name,
                     components);
}

std::string begin(const char* type) {
  return fmt::format(
      "<?xml version=\"1.0\"?>\n{}<VTKFile type=\"{}\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n",
      kMarkup, type);
}

/// One .vtp file: points, then single points and polygons on them, then data of the points.
class PolyData {
 public:
  std::vector<float> points;
  std::vector<std::int32_t> vertices, polygons, ends;  // `ends`: of each polygon in `polygons`

  void data(const char* name, const std::vector<float>& values, int components) {
    data_ += array("Float32", name, components, values);
    declared_ += declaration(name, components);
  }

  void write(const std::string& file) {
    std::vector<std::int32_t> each(vertices.size());
    for (std::size_t i = 0; i < each.size(); ++i) each[i] = static_cast<std::int32_t>(i + 1);
    std::string xml =
        begin("PolyData") + fmt::format(
                                "<PolyData>\n<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" "
                                "NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
                                points.size() / 3, vertices.size(), ends.size());
    xml += "<PointData>\n" + data_ + "</PointData>\n<Points>\n" +
           array("Float32", "Points", 3, points) + "</Points>\n<Verts>\n" +
           array("Int32", "connectivity", 1, vertices) + array("Int32", "offsets", 1, each) +
           "</Verts>\n<Polys>\n" + array("Int32", "connectivity", 1, polygons) +
           array("Int32", "offsets", 1, ends) +
           "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    write_fresh(file, xml + appended_ + "\n</AppendedData>\n</VTKFile>\n");
  }

  /// The .pvtp of pieces with data as these, in files beside it.
  void write_joined(const std::string& file, const std::vector<std::string>& pieces) const {
    std::string xml = begin("PPolyData") + "<PPolyData GhostLevel=\"0\">\n<PPointData>\n" +
                      declared_ + "</PPointData>\n<PPoints>\n" + declaration("Points", 3) +
                      "</PPoints>\n";
    for (const std::string& piece : pieces) xml += fmt::format("<Piece Source=\"{}\"/>\n", piece);
    write_fresh(file, xml + "</PPolyData>\n</VTKFile>\n");
  }

 private:
  /// A binary array behind the XML, with its length in front.
  template <class T>
  std::string array(const char* type, const char* name, int components,
                    const std::vector<T>& values) {
    const std::size_t offset = appended_.size();
    const std::uint64_t length = values.size() * sizeof(T);
    appended_.append(reinterpret_cast<const char*>(&length), sizeof length);
    if (length > 0) appended_.append(reinterpret_cast<const char*>(values.data()), length);
    return fmt::format(
        "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" "
        "offset=\"{}\"/>\n",
        type, name, components, offset);
  }
  std::string data_, declared_;  // the data in this file, and in each piece
  std::string appended_;
};

using Eigen::Vector3d;

/// Beyond it spheres are points with a radius (filter "Glyph"), not surfaces.

void put(std::vector<float>& out, const Vector3d& v) {
  for (int i = 0; i < 3; ++i) out.push_back(static_cast<float>(v[i]));
}

std::string film_of(const std::string& vtk) {
  return std::filesystem::path(vtk).replace_extension(".pvd").string();
}
std::string frames_of(const std::string& vtk) {
  return std::filesystem::path(vtk).replace_extension("").string();
}

class VtkRecorder : public Recorder {
 public:
  VtkRecorder(const std::string& file, const Beginning& run)
      : file_(film_of(file)),
        folder_(frames_of(file)),
        forces_(run.scene.output.forces),
        among_(run.among) {
    const Scene& scene = run.scene;
    if (run.resume.time) keep_up_to(*run.resume.time);
    make_folder_of(folder_ + "/x");
    if (among_.rank == 0) check_writable(file_);
    std::size_t surfaces = 0;
    for (const Body& body : scene.bodies) surfaces += body.shapes.size();
    const double half_plane = 2 * extent(scene);
    for (const Body& body : scene.bodies) {
      meshes_.emplace_back();
      for (const Shape& shape : body.shapes) {
        const bool as_point = shape.kind == ShapeKind::sphere && surfaces > 1000;
        meshes_.back().push_back(as_point ? Part{{{shape.position}, {}, {0}}, shape.radius}
                                          : Part{mesh(shape, kAround, half_plane), 0});
      }
    }
  }

  void record(const Engine& engine, const Diagnostics&) override {
    const double time = engine.time();
    add("bodies", 0, time, meshes_.size(), [&](Range of) { return bodies(engine, of); });
    const auto& touching = engine.contacts();
    if (!touching.empty())
      add("contacts", 1, time, touching.size(), [&](Range of) { return contacts(touching, of); });
    else
      remove_frame("contacts");
    if (forces_) {
      const Forces forces = engine.forces();
      if (!forces.joints.empty())
        add("joints", 2, time, forces.joints.size(), [&](Range of) { return joints(forces, of); });
      if (!forces.springs.empty())
        add("springs", 3, time, forces.springs.size(),
            [&](Range of) { return springs(forces, of); });
    }
    ++number_;
    // All files that the film names are there once the processes have met.
    if (among_.ranks > 1 && among_.meet) among_.meet();
  }

  void keep(const Engine&) override { write_film(); }

  void finish(std::vector<std::string>& written, std::vector<std::string>&) override {
    write_film();
    if (among_.rank == 0) written.push_back(file_);
  }

 private:
  struct Range {
    std::size_t first, last;
  };
  struct Part {
    Mesh mesh;
    double radius;
  };

  void write_film() {
    if (among_.rank != 0) return;
    write_whole(file_, std::string("<?xml version=\"1.0\"?>\n") + kMarkup +
                           "<VTKFile type=\"Collection\" version=\"1.0\" "
                           "byte_order=\"LittleEndian\">\n<Collection>\n" +
                           sets_ + "</Collection>\n</VTKFile>\n");
  }

  static double extent(const Scene& scene) {
    double half = 1;
    for (const Body& body : scene.bodies) half = std::max(half, body.position.norm());
    return half;
  }

  std::string frame(const std::string& what, const std::string& end) const {
    return fmt::format("{}_{:06}{}", what, number_, end);
  }
  static std::string piece(int rank) { return fmt::format("_p{}.vtp", rank); }

  /// A frame of `count` things, made of a range of them: each process writes its part.
  template <class Make>
  void add(const char* what, int part, double time, std::size_t count, Make make) {
    std::string end = ".vtp";
    if (among_.ranks <= 1) {
      make({0, count}).write(folder_ + '/' + frame(what, end));
    } else {
      const auto pieces = std::max<std::size_t>(1, std::min<std::size_t>(count, among_.ranks)),
                 mine = static_cast<std::size_t>(among_.rank);
      end = ".pvtp";
      if (mine < pieces) {
        PolyData data = make({count * mine / pieces, count * (mine + 1) / pieces});
        data.write(folder_ + '/' + frame(what, piece(among_.rank)));
        std::vector<std::string> names;
        for (int r = 0; r < static_cast<int>(pieces); ++r) names.push_back(frame(what, piece(r)));
        if (mine == 0) data.write_joined(folder_ + '/' + frame(what, end), names);
      }
    }
    sets_ += fmt::format("<DataSet timestep=\"{}\" part=\"{}\" file=\"{}/{}\"/>\n", time, part,
                         std::filesystem::path(folder_).filename().string(), frame(what, end));
  }

  // That of an earlier run, of which this one takes the names.
  void remove_frame(const char* what) const {
    std::error_code ignored;
    for (const std::string& end : {std::string(".vtp"), std::string(".pvtp"), piece(among_.rank)})
      std::filesystem::remove(folder_ + '/' + frame(what, end), ignored);
  }

  PolyData bodies(const Engine& engine, Range of) const {
    PolyData out;
    std::vector<float> index, radius, velocity, spin;
    for (std::size_t b = of.first; b < of.last; ++b) {
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
    out.data("body", index, 1);
    out.data("radius", radius, 1);
    out.data("velocity", velocity, 3);
    out.data("angular_velocity", spin, 3);
    return out;
  }

  template <class Item, class T>
  using Members = std::vector<std::pair<const char*, T Item::*>>;

  /// A point for each item, with these of its members.
  template <class Item, class Place>
  static PolyData cloud(const std::vector<Item>& all, Range of, Place place,
                        const Members<Item, Vector3d>& vectors,
                        const Members<Item, double>& scalars) {
    PolyData out;
    for (std::size_t k = of.first; k < of.last; ++k) {
      out.vertices.push_back(static_cast<std::int32_t>(out.vertices.size()));
      put(out.points, std::invoke(place, all[k]));
    }
    std::vector<float> values;
    for (const auto& [name, member] : vectors) {
      for (std::size_t k = of.first; k < of.last; ++k) put(values, all[k].*member);
      out.data(name, std::exchange(values, {}), 3);
    }
    for (const auto& [name, member] : scalars) {
      for (std::size_t k = of.first; k < of.last; ++k) values.push_back(float(all[k].*member));
      out.data(name, std::exchange(values, {}), 1);
    }
    return out;
  }

  PolyData contacts(const std::vector<ContactState>& all, Range of) const {
    using C = ContactState;
    Members<C, Vector3d> vectors = {{"impulse", &C::impulse}, {"normal", &C::normal}};
    if (forces_) vectors.insert(vectors.end(), {{"force", &C::force}, {"slip", &C::slip}});
    return cloud(all, of, &C::point, vectors, {{"gap", &C::gap}});
  }
  static PolyData joints(const Forces& forces, Range of) {
    using J = JointForce;
    return cloud(forces.joints, of, &J::at, {{"force", &J::force}, {"moment", &J::moment}},
                 {{"drive", &J::drive}});
  }
  static PolyData springs(const Forces& forces, Range of) {
    const auto middle = [](const SpringForce& s) { return Vector3d(0.5 * (s.at + s.at_second)); };
    return cloud(forces.springs, of, middle, {}, {{"tension", &SpringForce::tension}});
  }

  /// Takes over the frames of an earlier run, so that both make one film.
  void keep_up_to(double time) {
    if (is_device(file_)) return;
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
  Processes among_;
  long number_ = 0;
  std::vector<std::vector<Part>> meshes_;
};

std::vector<std::string> folders_of(const std::string& vtk, bool) { return {frames_of(vtk)}; }
bool is_frame(const std::string& path) {
  const auto end = std::filesystem::path(path).extension();
  return end == ".vtp" || end == ".pvtp";
}

}  // namespace

TETHER_FORMAT(vtk, ".pvd", "Film for ParaView (.pvd, with a folder of .vtp)",
              add_recorder<VtkRecorder>, folders_of, film_of, is_frame)

}  // namespace tether::scene::formats
