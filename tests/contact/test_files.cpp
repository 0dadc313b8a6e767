// Tether: files of contact problems. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <sstream>
#include <sys/stat.h>
#include <tether/contact/files.hpp>
#include <thread>

#ifdef TETHER_HAVE_HDF5
#include <hdf5.h>
#endif

#include "assemblies.hpp"
#include "support/catch.hpp"
#include "support/comma_locale.hpp"
#include "support/skip.hpp"
#include "temporary_file.hpp"

using namespace tether::contact;

namespace {

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
      CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
    }
    spill(file.path, good + " 1");  // one trailing integer is part of the format
    CHECK_NOTHROW(read_problem(file.path));
    for (const char* tail : {" 1 2", " 0.5", " x", " 1 0 0 0"}) {
      spill(file.path, good + tail);
      CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
    }
    for (const char* value : {"nan", "inf", "-inf", "1e999"}) {
      std::string bad = good;
      bad.replace(bad.rfind(' ', bad.size() - 3) + 1, 3, std::string(value) + " ");
      spill(file.path, bad);
      CHECK_THROWS_WITH(read_problem(file.path),
                        Catch::Contains("has an entry that is not finite") ||
                            Catch::Contains("out of the range of double"));
    }
    spill(file.path, "3\n999999999\n0\n9 9\n9 9\n");
    CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
    spill(file.path, "3\n1000000\n0\n3000000 3000000\n3000000 3000000\n1 2 3");
    CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);  // without claiming the memory
    spill(file.path, "3\n2\n0\n9 9\n9 9\n");
    CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("truncated"));
  }
  // The word is shown, and nothing behind it, and nothing that a terminal obeys.
  Temporary file("test_contact_terminal.dat");
  spill(file.path, "3\n\x1b[31mtwo\xc2\x9b three\n");
  CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("'?[31mtwo?"
                                                             "?'"));
  CHECK_THROWS_WITH(read_problem("no/such/file.dat"), Catch::Contains("cannot be opened"));
}

TEST_CASE("damaged fclib files are refused") {
  if (!has_fclib()) TETHER_SKIP("built without HDF5");
  random::Generator g(3);
  const Problem p = random::cluster(g, 0.4, 2, 3).problem();
  Temporary file("test_contact_damaged.hdf5");
  write_fclib(p, file.path);
  const std::string good = slurp(file.path);
  for (double part : {0.0, 0.1, 0.3, 0.5, 0.7, 0.9}) {
    spill(file.path,
          good.substr(0, static_cast<std::size_t>(part * static_cast<double>(good.size()))));
    CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
  }
  spill(file.path, "this is not HDF5");
  CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
}

#ifdef TETHER_HAVE_HDF5

namespace {

template <class T>
void store(hid_t file, const std::string& name, hid_t type, const std::vector<T>& values,
           hsize_t claimed = 0, hid_t made = H5P_DEFAULT) {
  const hsize_t size = claimed > 0 ? claimed : values.size();
  const hid_t space = H5Screate_simple(1, &size, nullptr), links = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(links, 1);
  const hid_t set =
      H5Dcreate2(file, ("/fclib_local/" + name).c_str(), type, space, links, made, H5P_DEFAULT);
  if (claimed == 0) H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(set);
  H5Pclose(links);
  H5Sclose(space);
}

// One contact, W the identity in compressed columns with the given pointers. claimed > 0: W/x says
// that it has so many entries, none of them written.
void write_columns(const std::string& path, const std::vector<int>& pointers, hsize_t claimed = 0,
                   hid_t made = H5P_DEFAULT, const std::vector<int>& rows = {0, 1, 2}) {
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  store<int>(file, "spacedim", H5T_NATIVE_INT, {3});
  store<int>(file, "W/m", H5T_NATIVE_INT, {3});
  store<int>(file, "W/n", H5T_NATIVE_INT, {3});
  store<int>(file, "W/nz", H5T_NATIVE_INT, {-1});
  store<int>(file, "W/p", H5T_NATIVE_INT, pointers);
  store<int>(file, "W/i", H5T_NATIVE_INT, rows);
  store<double>(file, "W/x", H5T_NATIVE_DOUBLE, {1, 1, 1}, claimed, made);
  store<double>(file, "vectors/q", H5T_NATIVE_DOUBLE, {-1, 0, 0});
  store<double>(file, "vectors/mu", H5T_NATIVE_DOUBLE, {0.5});
  H5Fclose(file);
}

}  // namespace

TEST_CASE(
    "fclib: column pointers that decrease or exceed are refused, and sizes that the file cannot "
    "hold") {
  Temporary file("test_contact_hostile.hdf5");
  write_columns(file.path, {0, 1, 2, 3});
  CHECK(read_problem(file.path).contacts() == 1);
  for (const std::vector<int>& pointers : {std::vector<int>{0, 100000000, 2, 3},
                                           {0, 2, 1, 3},
                                           {-1, 1, 2, 3},
                                           {0, 1, 100000000, 3},
                                           {0, -5, 2, 3}}) {
    write_columns(file.path, pointers);
    CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("W/p must ascend from 0"));
  }
  for (const std::vector<int>& rows : {std::vector<int>{0, 1, 3}, {0, -1, 2}, {2147483647, 1, 2}}) {
    write_columns(file.path, {0, 1, 2, 3}, 0, H5P_DEFAULT, rows);
    CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("W has an index outside"));
  }
  write_columns(file.path, {0, 1, 2, 100000000});
  CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("W/p must ascend from 0"));
  write_columns(file.path, {0, 1, 2, 3}, hsize_t{1} << 30);
  CHECK_THROWS_WITH(read_problem(file.path),
                    Catch::Contains("1073741824 entries, but the file holds 0 bytes"));
}

TEST_CASE("fclib: no other file is read, and no filter that HDF5 does not come with") {
  Temporary file("test_contact_leads.hdf5"), other("test_contact_other.hdf5"),
      raw("test_contact_raw.bin");
  write_columns(other.path, {0, 1, 2, 3});
  spill(raw.path, std::string(24, '\0'));
  const auto with = [&](auto&& change) {
    const hid_t made = H5Pcreate(H5P_DATASET_CREATE);
    change(made);
    write_columns(file.path, {0, 1, 2, 3}, 0, made);
    H5Pclose(made);
  };
  const auto deflate = [](hid_t made) {
    const hsize_t size = 3;
    H5Pset_chunk(made, 1, &size);
    H5Pset_deflate(made, 9);
  };
  with(deflate);
  CHECK(read_problem(file.path).contacts() == 1);
  with([&](hid_t made) {
    deflate(made);
    H5Pset_deflate(made, 9);
  });
  CHECK_THROWS_WITH(read_problem(file.path),
                    Catch::Contains("a filter that HDF5 does not come with"));
  with([&](hid_t made) {
    deflate(made);
    H5Pset_filter(made, 32001, H5Z_FLAG_OPTIONAL, 0, nullptr);
  });
  CHECK_THROWS_WITH(read_problem(file.path),
                    Catch::Contains("a filter that HDF5 does not come with"));
  with([&](hid_t made) { H5Pset_external(made, raw.path.c_str(), 0, 24); });
  CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("lies in another file"));
  with([&](hid_t made) {
    const hsize_t size = 3;
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    H5Pset_virtual(made, space, other.path.c_str(), "/fclib_local/W/x", space);
    H5Sclose(space);
  });
  CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("lies in another file"));
  // By links: of the data, and of the group above.
  for (const char* name : {"/fclib_local/W/x", "/fclib_local/vectors"}) {
    write_columns(file.path, {0, 1, 2, 3});
    const hid_t open = H5Fopen(file.path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    H5Ldelete(open, name, H5P_DEFAULT);
    H5Lcreate_external(other.path.c_str(), name, open, name, H5P_DEFAULT, H5P_DEFAULT);
    H5Fclose(open);
    CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("a link to another file"));
  }
}

#endif

TEST_CASE("a pipe is read as .dat, and what never ends is left") {
  random::Generator g(4);
  const Problem p = random::cluster(g, 0.4, 2, 3).problem();
  Temporary file("test_contact_piped.dat"), pipe("test_contact_pipe");
  write_dat(p, file.path);
  REQUIRE(mkfifo(pipe.path.c_str(), 0600) == 0);
  std::thread writer([&] { spill(pipe.path, slurp(file.path)); });
  const Problem q = read_problem(pipe.path);
  writer.join();
  CHECK(equal(p, q));
  CHECK_THROWS_WITH(read_problem("/dev/zero"), Catch::Contains("binary data"));
}

TEST_CASE("files are written and read alike in every locale") {
  random::Generator g(5);
  const Problem p = random::cluster(g, 0.4, 2, 3).problem();
  Temporary here("test_contact_here.dat"), there("test_contact_there.dat");
  write_dat(p, here.path);
  const tether::test::CommaLocale comma;
  if (!comma.of_c()) WARN("skipped in part: no locale with a decimal comma is installed here");
  write_dat(p, there.path);
  CHECK(equal(p, read_problem(here.path)));
  CHECK(slurp(here.path) == slurp(there.path));
  Temporary many("test_contact_many.dat");
  spill(many.path, "3\n12345678.5\n");
  CHECK_THROWS_WITH(read_problem(many.path),
                    Catch::Contains("is 1.23457e+07; an integer from 0 to 10000000"));
}

TEST_CASE(".dat: numbers are whole words within the range of double precision") {
  Temporary file("test_contact_words.dat");
  const std::string head = "3\n1\n0\n3\n3\n3 3\n", matrix = "1 0 0 0 1 0 0 0 1\n";
  spill(file.path, head + matrix + "+1.5 0 -0\n5e-1\n");
  CHECK(read_problem(file.path).b()[0] == -1.5);
  for (const char* word : {"1,5", "0x10", "1.5.2", "1e999", "--1", "+-1", "1d3"}) {
    spill(file.path, head + matrix + word + " 0 0\n0.5\n");
    CHECK_THROWS_AS(read_problem(file.path), std::runtime_error);
  }
}
