// Tether: a .vtp file, and a .pvtp that joins some. SPDX-License-Identifier: BSD-3-Clause
#include "record/poly_data.hpp"

#include <fmt/format.h>

#include "output/own_files.hpp"
#include "output/whole_file.hpp"

namespace tether::scene {

namespace {

std::string array(const char* type, const char* name, int components, std::size_t offset) {
  return fmt::format(
      "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" "
      "offset=\"{}\"/>\n",
      type, name, components, offset);
}

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

}  // namespace

void PolyData::data(const char* name, const std::vector<float>& values, int components) {
  data_ += array("Float32", name, components, appended_.add(values));
  declared_ += declaration(name, components);
}

void PolyData::write(const std::string& file) {
  std::vector<std::int32_t> each(vertices.size());
  for (std::size_t i = 0; i < each.size(); ++i) each[i] = static_cast<std::int32_t>(i + 1);
  std::string xml =
      begin("PolyData") + fmt::format(
                              "<PolyData>\n<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"{}\" "
                              "NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n",
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

void PolyData::write_joined(const std::string& file, const std::vector<std::string>& pieces) const {
  std::string xml = begin("PPolyData") + "<PPolyData GhostLevel=\"0\">\n<PPointData>\n" +
                    declared_ + "</PPointData>\n<PPoints>\n" + declaration("Points", 3) +
                    "</PPoints>\n";
  for (const std::string& piece : pieces) xml += fmt::format("<Piece Source=\"{}\"/>\n", piece);
  write_fresh(file, xml + "</PPolyData>\n</VTKFile>\n");
}

}  // namespace tether::scene
