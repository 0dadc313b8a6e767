// Tether: files of contact problems. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <fstream>
#include <sstream>
#include <tether/contact/files.hpp>

#include "assemblies.hpp"
#include "support/catch.hpp"

using namespace tether::contact;

namespace {

std::string slurp(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream all;
  all << file.rdbuf();
  return all.str();
}

void spill(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

struct Temporary {
  std::string path;
  explicit Temporary(const std::string& name) : path(name) {}
  ~Temporary() { std::remove(path.c_str()); }
};

bool equal(const Problem& p, const Problem& q) {
  if (p.contacts() != q.contacts() || p.dimension() != q.dimension()) return false;
  for (int i = 0; i < p.contacts(); ++i)
    if (p.mu(i) != q.mu(i)) return false;
  return p.dense_matrix() == q.dense_matrix() && p.b() == q.b();
}

}  // namespace

TEST_CASE("what is written is read back") {
  random::Generator g(1);
  const Problem p = random::cluster(g, 0.4).problem();
  Eigen::MatrixXd A2(4, 4);
  A2 << 2, 0.1, 0.3, 0, 0.1, 2, 0, 0, 0.3, 0, 2, 0, 0, 0, 0, 2;
  const Problem flat = Problem::dense(A2, Eigen::VectorXd::Ones(4), Eigen::VectorXd::Ones(2));
  for (const Problem* q : {&p, &flat}) {
    for (DatStorage storage : {DatStorage::dense, DatStorage::blocks}) {
      Temporary file("test_contact_written.dat");
      write_dat(*q, file.path, storage);
      CHECK(equal(*q, read_dat(file.path)));
      CHECK(equal(*q, read_problem(file.path)));
    }
    if (has_fclib()) {
      Temporary file("test_contact_written.hdf5");
      write_fclib(*q, file.path);
      CHECK(equal(*q, read_problem(file.path)));
    }
  }
}

TEST_CASE("damaged .dat files are refused") {
  random::Generator g(2);
  const Problem p = random::cluster(g, 0.4, 2, 3).problem();
  for (DatStorage storage : {DatStorage::dense, DatStorage::blocks}) {
    Temporary file("test_contact_damaged.dat");
    write_dat(p, file.path, storage);
    const std::string good = slurp(file.path);
    for (std::size_t keep = 0; keep + 2 < good.size(); keep += 1 + keep / 7) {
      // Cut between numbers or inside one: the count of numbers is short.
      spill(file.path, good.substr(0, keep));
      CHECK_THROWS_AS(read_dat(file.path), std::runtime_error);
    }
    spill(file.path, good + " 1");  // one trailing integer is part of the format
    CHECK_NOTHROW(read_dat(file.path));
    for (const char* tail : {" 1 2", " 0.5", " x", " 1 0 0 0"}) {
      spill(file.path, good + tail);
      CHECK_THROWS_AS(read_dat(file.path), std::runtime_error);
    }
    for (const char* value : {"nan", "inf", "-inf", "1e999"}) {
      std::string bad = good;
      bad.replace(bad.rfind(' ', bad.size() - 3) + 1, 3, std::string(value) + " ");
      spill(file.path, bad);
      CHECK_THROWS_AS(read_dat(file.path), std::runtime_error);
    }
    spill(file.path, "3\n999999999\n0\n9 9\n9 9\n");
    CHECK_THROWS_AS(read_dat(file.path), std::runtime_error);
    spill(file.path, "3\n1000000\n0\n3000000 3000000\n3000000 3000000\n1 2 3");
    CHECK_THROWS_AS(read_dat(file.path), std::runtime_error);  // without claiming the memory
    spill(file.path, "3\n2\n0\n9 9\n9 9\n");
    CHECK_THROWS_WITH(read_dat(file.path), Catch::Contains("2 contacts of dimension 3 need 6"));
  }
  CHECK_THROWS_WITH(read_dat("no/such/file.dat"), Catch::Contains("cannot be opened"));
}

TEST_CASE("damaged fclib files are refused") {
  if (!has_fclib()) {
    WARN("built without HDF5");
    return;
  }
  random::Generator g(3);
  const Problem p = random::cluster(g, 0.4, 2, 3).problem();
  Temporary file("test_contact_damaged.hdf5");
  write_fclib(p, file.path);
  const std::string good = slurp(file.path);
  for (double part : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    spill(file.path, good.substr(0, static_cast<std::size_t>(part * static_cast<double>(good.size()))));
    CHECK_THROWS_AS(read_fclib(file.path), std::runtime_error);
  }
  spill(file.path, "this is not HDF5");
  CHECK_THROWS_AS(read_fclib(file.path), std::runtime_error);
  CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
}
