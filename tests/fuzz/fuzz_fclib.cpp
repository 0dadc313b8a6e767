// Fuzz target of the fclib reader: files that are HDF5, with contents of any kind.
// SPDX-License-Identifier: BSD-3-Clause
//
// An input is a text, a data set on each line: its name (in fclib_local, or from the root with /),
// i or d, how many entries it claims to have (-: as many as follow), and its entries. Damaged HDF5
// itself is the HDF5 library's to refuse.
#include <hdf5.h>

#include <sstream>
#include <string>

#include "driver.hpp"
#include "memory_file.hpp"
#include "solve_read.hpp"
#include <tether/contact/files.hpp>

using namespace tether;

namespace {

constexpr std::size_t kMostEntries = 5000;

template <class T>
std::vector<T> entries(std::istream& in) {
  std::vector<T> out;
  std::string word;
  while (out.size() < kMostEntries && in >> word)
    out.push_back(static_cast<T>(std::strtod(word.c_str(), nullptr)));
  return out;
}
// Numbers beyond an int are its bounds: the conversion would be undefined.
template <>
std::vector<int> entries(std::istream& in) {
  std::vector<int> out;
  for (const double x : entries<double>(in))
    out.push_back(x >= 2147483647.0   ? 2147483647
                  : x > -2147483648.0 ? static_cast<int>(x)
                                      : -2147483647 - 1);
  return out;
}

template <class T>
void put(hid_t file, const std::string& name, hid_t type, const std::vector<T>& values,
         const std::string& claim) {
  hsize_t size = values.size();
  if (claim != "-")
    size = static_cast<hsize_t>(std::strtoull(claim.c_str(), nullptr, 10)) % (1u << 30);
  const hid_t space = H5Screate_simple(1, &size, nullptr);
  const hid_t links = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(links, 1);
  const hid_t set = H5Dcreate2(file, (name[0] == '/' ? name : "/fclib_local/" + name).c_str(), type,
                               space, links, H5P_DEFAULT, H5P_DEFAULT);
  if (set >= 0 && size == values.size() && size > 0)
    H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  if (set >= 0) H5Dclose(set);
  H5Pclose(links);
  H5Sclose(space);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::MemoryFile place("hdf5");
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const hid_t file = H5Fcreate(place.path().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  if (file < 0) return 0;
  std::istringstream lines(std::string(reinterpret_cast<const char*>(data), size));
  std::string line;
  for (int k = 0; k < 30 && std::getline(lines, line); ++k) {
    std::istringstream in(line);
    std::string name, type, claim;
    if (!(in >> name >> type >> claim) || name.find('\0') != std::string::npos) continue;
    if (type == "i")
      put(file, name, H5T_NATIVE_INT, entries<int>(in), claim);
    else
      put(file, name, H5T_NATIVE_DOUBLE, entries<double>(in), claim);
  }
  H5Fclose(file);
  try {
    fuzz::solve_read(contact::read_problem(place.path()));
  } catch (const std::runtime_error&) {  // the file says why
  }
  try {
    fuzz::solve_read(contact::read_cones(place.path()));
  } catch (const std::runtime_error&) {
  }
  return 0;
}

std::vector<std::string> own_corpus() { return {}; }
