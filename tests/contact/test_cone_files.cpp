// Tether: files of problems over cones. SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <sstream>
#include <tether/contact/files.hpp>

#ifdef TETHER_HAVE_HDF5
#include <hdf5.h>
#endif

#include "assemblies.hpp"
#include "support/catch.hpp"
#include "temporary_file.hpp"

using namespace tether::contact;

namespace {

// The same law, cones and data, A and b to a relative error.
bool alike(const ConeProblem& p, const ConeProblem& q, double error) {
  if (p.rows() != q.rows() || p.cones().size() != q.cones().size()) return false;
  for (std::size_t k = 0; k < p.cones().size(); ++k)
    if (p.cones()[k].kind != q.cones()[k].kind || p.cones()[k].rows != q.cones()[k].rows ||
        p.cones()[k].mu != q.cones()[k].mu || p.cones()[k].rolling != q.cones()[k].rolling)
      return false;
  return (p.dense_matrix() - q.dense_matrix()).norm() <= error * p.dense_matrix().norm() &&
         (p.b() - q.b()).norm() <= error * p.b().norm();
}

// A ball of 2 kg that rolls on a floor: M, H (six velocities, five rows), f and w; and W, q.
struct RollingFile {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(6, 6), H = Eigen::MatrixXd::Zero(6, 5);
  Eigen::VectorXd f = Eigen::VectorXd::LinSpaced(6, -1, 1),
                  w = Eigen::VectorXd::LinSpaced(5, -2, 0.5);
  RollingFile() {
    M.diagonal() << 2, 2, 2, 0.008, 0.008, 0.008;
    M(3, 4) = M(4, 3) = 0.001;
    H.topLeftCorner(3, 3).setIdentity();
    H(4, 1) = 0.1;
    H(3, 2) = -0.1;
    H(3, 3) = H(4, 4) = 1;
  }
  ConeProblem wanted() const {
    const Eigen::MatrixXd X = M.inverse();
    return ConeProblem::dense(H.transpose() * X * H, -(H.transpose() * X * f + w),
                              {Cone::with_rolling(0.5, 0.25)});
  }
};

std::string numbers(const Eigen::MatrixXd& A) {
  std::ostringstream out;
  out.precision(17);
  for (Eigen::Index c = 0; c < A.cols(); ++c)
    for (Eigen::Index r = 0; r < A.rows(); ++r) out << A(r, c) << ' ';
  return out.str() + "\n";
}

// As Siconos writes a matrix: 0 dense, 1 one block, 2 triplets, 3 columns.
std::string matrix(const Eigen::MatrixXd& A, int form) {
  const std::string m = std::to_string(A.rows()), n = std::to_string(A.cols()),
                    count = std::to_string(A.size());
  const std::string version = "CSparse Version 3.2.0, Sept 12, 2017.  Copyright (c) ...\n",
                    head = m + "-by-" + n + ", nzmax: " + count + " nnz: " + count;
  if (form == 0) return "0\n" + m + "\n" + n + "\n" + m + "\t" + n + "\n" + numbers(A);
  if (form == 1)
    return "1\n" + m + "\n" + n + "\n1\n1\n1\n" + m + "\n" + n + "\n2\t1\n0 1\n0\n0\n" + numbers(A);
  std::ostringstream out;
  out.precision(17);
  out << "2\n" << m << "\n" << n << "\n" << form - 1 << "\n" << version;
  out << (form == 2 ? "triplet: " + head : head + ", 1-norm: 1.5") << "\n";
  for (Eigen::Index c = 0; c < A.cols(); ++c) {
    if (form == 3)
      out << "    col " << c << " : locations " << c * A.rows() << " to " << (c + 1) * A.rows() - 1
          << "\n";
    for (Eigen::Index r = 0; r < A.rows(); ++r) {
      out << "      " << r;
      if (form == 2) out << " " << c;
      out << " : " << A(r, c) << "\n";
    }
  }
  return out.str();
}

}  // namespace

TEST_CASE("files of cones: .dat, local and global, with rolling friction, in every storage") {
  const RollingFile ball;
  const ConeProblem wanted = ball.wanted();
  Temporary file("test_contact_cones.dat");
  for (int form = 0; form < 4; ++form) {
    CAPTURE(form);
    spill(file.path,
          "5\n1\n" + matrix(wanted.dense_matrix(), form) + numbers(-wanted.b()) + "0.5\n0.25\n");
    CHECK(alike(read_cones(file.path), wanted, 1e-15));
    spill(file.path, "5\n1\n" + matrix(ball.M, form) + matrix(ball.H, form) + numbers(ball.f) +
                         numbers(ball.w) + "0.5\n0.25\n0\n");
    CHECK(alike(read_cones(file.path), wanted, 1e-14));
    const std::string good = slurp(file.path);
    for (std::size_t keep = 0; keep + 6 < good.size(); keep += 1 + keep / 9) {
      spill(file.path, good.substr(0, keep));
      CHECK_THROWS_AS(read_cones(file.path), std::runtime_error);
    }
    spill(file.path, good + " 1 2");
    CHECK_THROWS_WITH(read_cones(file.path), Catch::Contains("oversized") ||
                                                 Catch::Contains("H is") ||
                                                 Catch::Contains("storage"));
  }
  // A global file whose M has the size of a local one.
  const Eigen::MatrixXd M3 = 2 * Eigen::Matrix3d::Identity(), H3 = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d f3(1, 2, 3), w3(-3, 0, 1);
  spill(file.path, "3\n1\n" + matrix(M3, 0) + matrix(H3, 2) + numbers(f3) + numbers(w3) + "0.5\n");
  CHECK(alike(read_cones(file.path),
              ConeProblem::dense(M3 / 4, -(f3 / 2 + w3), {Cone::friction(0.5)}), 1e-15));
  // Sparse friction problems are problems of contacts, too.
  random::Generator g(1);
  const Problem p = random::cluster(g, 0.4).problem();
  Eigen::VectorXd mu(p.contacts());
  for (int i = 0; i < p.contacts(); ++i) mu[i] = p.mu(i);
  for (int form : {2, 3}) {
    spill(file.path, "3\n" + std::to_string(p.contacts()) + "\n" + matrix(p.dense_matrix(), form) +
                         numbers(-p.b()) + numbers(mu));
    CHECK(read_problem(file.path).dense_matrix() == p.dense_matrix());
    CHECK((read_cones(file.path).dense_matrix() - p.dense_matrix()).norm() == 0);
  }
  for (const char* bad :
       {"3\n1\n2\n3\n3\n1\nCSparse\ntriplet: 3-by-3, nzmax: 9 nnz: 999999999\n 0 0 : 1\n",
        "3\n1\n2\n3\n3\n1\nCSparse\ntriplet: 3-by-4, nzmax: 9 nnz: 1\n 0 0 : 1\n",
        "3\n1\n2\n3\n3\n2\nCSparse\n3-by-3, nzmax: 9 nnz: 1, 1-norm: 1\n col 0 : locations 1 to "
        "1\n",
        "3\n1\n2\n3\n3\n7\nCSparse\n", "3\n1\n2\n3\n3\n1\nsomething\n", "4\n1\n0\n4\n4\n",
        "5\n1\n1\n5\n5\n999999999\n5\n5\n"}) {
    CAPTURE(bad);
    spill(file.path, bad);
    CHECK_THROWS_AS(read_cones(file.path), std::runtime_error);
  }
}

#ifdef TETHER_HAVE_HDF5

namespace {

template <class T>
void put(hid_t file, const std::string& name, hid_t type, const std::vector<T>& values) {
  const hsize_t size = values.size();
  const hid_t space = H5Screate_simple(1, &size, nullptr), links = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(links, 1);
  const hid_t set = H5Dcreate2(file, name.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(set);
  H5Pclose(links);
  H5Sclose(space);
}

void put(hid_t file, const std::string& name, const Eigen::VectorXd& v) {
  put<double>(file, name, H5T_NATIVE_DOUBLE, std::vector<double>(v.data(), v.data() + v.size()));
}

// form: 0 triplets, -1 columns, -2 rows.
void put(hid_t file, const std::string& name, const Eigen::MatrixXd& A, int form) {
  const int m = static_cast<int>(A.rows()), n = static_cast<int>(A.cols());
  std::vector<int> p, i;
  std::vector<double> x;
  const bool rows = form == -2;
  for (int a = 0; a < (rows ? m : n); ++a) {
    if (form != 0) p.push_back(static_cast<int>(x.size()));
    for (int b = 0; b < (rows ? n : m); ++b) {
      if (form == 0) p.push_back(a);
      i.push_back(b);
      x.push_back(rows ? A(a, b) : A(b, a));
    }
  }
  if (form != 0) p.push_back(static_cast<int>(x.size()));
  const int nz = form == 0 ? static_cast<int>(x.size()) : form;
  put<int>(file, name + "/m", H5T_NATIVE_INT, {m});
  put<int>(file, name + "/n", H5T_NATIVE_INT, {n});
  put<int>(file, name + "/nz", H5T_NATIVE_INT, {nz});
  put<int>(file, name + "/p", H5T_NATIVE_INT, p);
  put<int>(file, name + "/i", H5T_NATIVE_INT, i);
  put<double>(file, name + "/x", H5T_NATIVE_DOUBLE, x);
}

}  // namespace

TEST_CASE("files of cones: fclib, local and global with joints, with rolling friction") {
  Temporary file("test_contact_cones.hdf5");
  const auto make = [&] {
    return H5Fcreate(file.path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  };
  // A contact and two rows of joints.
  const Eigen::MatrixXd J = Eigen::MatrixXd::NullaryExpr(5, 6, [](Eigen::Index i, Eigen::Index j) {
    return (i == j ? 2.0 : 0.0) + 0.1 * static_cast<double>((3 * i + 5 * j) % 7);
  });
  const Eigen::MatrixXd M = Eigen::VectorXd::LinSpaced(6, 1, 3).asDiagonal();
  const Eigen::VectorXd f = Eigen::VectorXd::LinSpaced(6, -1, 2),
                        bias = Eigen::VectorXd::LinSpaced(5, -3, 1);
  const Eigen::MatrixXd A = J * M.inverse() * J.transpose();
  const Eigen::VectorXd b = -(J * M.inverse() * f + bias);
  const ConeProblem wanted = ConeProblem::dense(A, b, {Cone::friction(0.5), Cone::free(2)});
  for (int form : {0, -1, -2}) {
    CAPTURE(form);
    hid_t id = make();
    put<int>(id, "/fclib_global/spacedim", H5T_NATIVE_INT, {3});
    put(id, "/fclib_global/M", M, form);
    put(id, "/fclib_global/H", J.topRows(3).transpose(), form);
    put(id, "/fclib_global/G", J.bottomRows(2).transpose(), form);
    put(id, "/fclib_global/vectors/f", f);
    put(id, "/fclib_global/vectors/w", bias.head(3));
    put(id, "/fclib_global/vectors/b", bias.tail(2));
    put(id, "/fclib_global/vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    H5Fclose(id);
    CHECK(alike(read_cones(file.path), wanted, 1e-14));
    id = make();
    put<int>(id, "/fclib_local/spacedim", H5T_NATIVE_INT, {3});
    put(id, "/fclib_local/W", A.topLeftCorner(3, 3), form);
    put(id, "/fclib_local/V", A.topRightCorner(3, 2), form);
    put(id, "/fclib_local/R", A.bottomRightCorner(2, 2), form);
    put(id, "/fclib_local/vectors/q", -b.head(3));
    put(id, "/fclib_local/vectors/s", -b.tail(2));
    put(id, "/fclib_local/vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    H5Fclose(id);
    CHECK(alike(read_cones(file.path), wanted, 1e-15));
    CHECK_THROWS_WITH(read_problem(file.path), Catch::Contains("has rows of joints"));
    const RollingFile ball;
    id = make();
    put<int>(id, "/fclib_global_rolling/spacedim", H5T_NATIVE_INT, {5});
    // Half of M, as LMGC90 writes it.
    put(id, "/fclib_global_rolling/M", Eigen::MatrixXd(ball.M.triangularView<Eigen::Upper>()),
        form);
    put(id, "/fclib_global_rolling/H", ball.H, form);
    put(id, "/fclib_global_rolling/vectors/f", ball.f);
    put(id, "/fclib_global_rolling/vectors/w", ball.w);
    put(id, "/fclib_global_rolling/vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    put(id, "/fclib_global_rolling/vectors/mu_r", Eigen::VectorXd::Constant(1, 0.25));
    H5Fclose(id);
    CHECK(alike(read_cones(file.path), ball.wanted(), 1e-14));
    id = make();  // an index of M beyond it
    put<int>(id, "/fclib_global/spacedim", H5T_NATIVE_INT, {3});
    put(id, "/fclib_global/M", M, form);
    H5Ldelete(id, "/fclib_global/M/m", H5P_DEFAULT);
    H5Ldelete(id, "/fclib_global/M/n", H5P_DEFAULT);
    put<int>(id, "/fclib_global/M/m", H5T_NATIVE_INT, {form == -2 ? 6 : 5});
    put<int>(id, "/fclib_global/M/n", H5T_NATIVE_INT, {form == -2 ? 5 : 6});
    put(id, "/fclib_global/H", J.topRows(3).transpose(), form);
    put(id, "/fclib_global/vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    H5Fclose(id);
    CHECK_THROWS_WITH(read_cones(file.path), Catch::Contains("M has an index outside"));
    id = make();  // H of another size
    put<int>(id, "/fclib_global/spacedim", H5T_NATIVE_INT, {3});
    put(id, "/fclib_global/M", M, form);
    put(id, "/fclib_global/H", J.topRows(2).transpose(), form);
    put(id, "/fclib_global/vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    H5Fclose(id);
    CHECK_THROWS_WITH(read_cones(file.path), Catch::Contains("H is 6 x 2, 6 x 3 is expected"));
  }
}

TEST_CASE("files of cones: joints that fclib claims without end are refused") {
  Temporary file("test_contact_cones_claims.hdf5");
  constexpr int kMost = std::numeric_limits<int>::max();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(3, 3);
  // A matrix of one entry, as far away as the claim goes.
  const auto claim = [](hid_t id, const std::string& name, int m, int n) {
    put<int>(id, name + "/m", H5T_NATIVE_INT, {m});
    put<int>(id, name + "/n", H5T_NATIVE_INT, {n});
    put<int>(id, name + "/nz", H5T_NATIVE_INT, {1});
    put<int>(id, name + "/p", H5T_NATIVE_INT, {n - 1});
    put<int>(id, name + "/i", H5T_NATIVE_INT, {m - 1});
    put<double>(id, name + "/x", H5T_NATIVE_DOUBLE, {1});
  };
  for (const bool local : {true, false}) {
    CAPTURE(local);
    const hid_t id = H5Fcreate(file.path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const std::string group = local ? "/fclib_local/" : "/fclib_global/";
    put<int>(id, group + "spacedim", H5T_NATIVE_INT, {3});
    put(id, group + "vectors/mu", Eigen::VectorXd::Constant(1, 0.5));
    put(id, group + (local ? "W" : "M"), one, 0);
    if (local) {
      claim(id, group + "V", 3, kMost);
      claim(id, group + "R", kMost, kMost);
      put(id, group + "vectors/q", Eigen::VectorXd::Ones(3));
    } else {
      put(id, group + "H", one, 0);
      claim(id, group + "G", 3, kMost);
      put(id, group + "vectors/f", Eigen::VectorXd::Ones(3));
      put(id, group + "vectors/w", Eigen::VectorXd::Ones(3));
    }
    H5Fclose(id);
    CHECK_THROWS_WITH(read_cones(file.path),
                      Catch::Contains("2147483647 rows of joints, more than there can be"));
  }
}

#endif
