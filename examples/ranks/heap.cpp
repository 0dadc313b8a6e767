// Tether: a heap of spheres over MPI ranks, the same bits for any number of them.
// SPDX-License-Identifier: BSD-3-Clause
//
// mpiexec -n 4 example_ranks_heap --spheres 10000 --steps 500 [--pictures heap]
//
// Spheres fall into a box. Each rank owns those of its part of the space, has copies of others near
// by, finds the contacts whose sphere with the smaller number it owns, and moves its own. Every 20
// steps spheres change their ranks. --pictures: NAME.pvtu joins one piece of each rank.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string>
#include <tether/contact_mpi.hpp>
#include <tuple>

namespace tc = tether::contact;
namespace tcm = tether::contact_mpi;
using Eigen::Vector3d;

namespace {

constexpr double kRadius = 0.05, kStep = 5e-3, kGravity = 9.81, kFriction = 0.4;  // m, s, m/s^2
constexpr double kReach = 0.02;  // gaps below this are contacts, m
constexpr int kNumbers = 10;     // of a sphere in a message

struct Sphere {
  int number;
  Vector3d x, v, w;
};

struct Settings {
  int spheres = 10000, steps = 500;
  std::string pictures;
};

Settings settings(int argc, char** argv) {
  Settings s;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    const auto value = [&] {
      if (++k == argc) throw std::invalid_argument(word + " needs a value");
      return argv[k];
    };
    if (word == "--spheres") {
      s.spheres = std::stoi(value());
    } else if (word == "--steps") {
      s.steps = std::stoi(value());
    } else if (word == "--pictures") {
      s.pictures = value();
    } else {
      throw std::invalid_argument(word + ": there are --spheres, --steps, --pictures");
    }
  }
  if (s.spheres < 1) throw std::invalid_argument("--spheres must be >= 1");
  return s;
}

// Spheres of this rank, and the box around them all.
class Heap {
 public:
  Heap(MPI_Comm comm, const Settings& s) : comm_(comm), solver_(comm, options()) {
    MPI_Comm_size(comm, &ranks_);
    MPI_Comm_rank(comm, &rank_);
    const int side = std::max(2, static_cast<int>(std::cbrt(s.spheres / 2.0)));
    width_ = 2.4 * kRadius * side;
    for (int k = 0; k < s.spheres; ++k) {
      if (k % ranks_ != rank_) continue;
      // A loose lattice, pushed out of order.
      const Vector3d place(k % side, k / side % side, k / side / side);
      const Vector3d off(std::sin(12.9898 * k), std::sin(78.233 * k), std::sin(37.719 * k));
      own_.push_back({k, kRadius * (2.4 * place + Vector3d::Constant(1.2) + 0.15 * off),
                      Vector3d::Zero(), Vector3d::Zero()});
    }
  }

  void step() {
    if (steps_++ % 20 == 0) spread();
    copy_near();
    find_contacts();
    solver_.solve(share_, solution_);
    for (std::size_t k = 0; k < own_.size(); ++k) {
      own_[k].v = solution_.velocities[k];
      own_[k].w = solution_.angular_velocities[k];
      own_[k].x += kStep * own_[k].v;
    }
  }
  const tcm::Solution& solution() const { return solution_; }
  std::size_t spheres() const { return own_.size(); }

  // Hash of all positions and velocities in the order of their numbers.
  std::uint64_t hash() const {
    const std::vector<Sphere> all =
        unpacked(tcm::send(comm_, kNumbers, packed(own_), std::vector<int>(own_.size(), 0)));
    std::map<int, const Sphere*> sorted;
    for (const Sphere& s : all) sorted[s.number] = &s;
    std::uint64_t h = 14695981039346656037u;
    for (const auto& [number, s] : sorted) {
      for (const Vector3d* v : {&s->x, &s->v, &s->w}) {
        unsigned char bytes[24];
        std::memcpy(bytes, v->data(), 24);
        for (unsigned char byte : bytes) h = (h ^ byte) * 1099511628211u;
      }
    }
    return h;
  }

  void write(const std::string& name) const;

 private:
  static tcm::Options options() {
    tcm::Options o;
    o.law = tc::Law::coulomb;
    o.tolerance = 1e-4;
    o.max_sweeps = 60;
    o.max_assembled = 0;
    return o;
  }
  static std::vector<double> packed(const std::vector<Sphere>& spheres) {
    std::vector<double> out;
    for (const Sphere& s : spheres) {
      out.push_back(s.number);
      for (const Vector3d* v : {&s.x, &s.v, &s.w}) out.insert(out.end(), v->data(), v->data() + 3);
    }
    return out;
  }
  static std::vector<Sphere> unpacked(const std::vector<double>& numbers) {
    std::vector<Sphere> out;
    for (std::size_t k = 0; k < numbers.size(); k += kNumbers) {
      const double* n = numbers.data() + k;
      using Map = Eigen::Map<const Vector3d>;
      out.push_back({static_cast<int>(n[0]), Map(n + 1), Map(n + 4), Map(n + 7)});
    }
    return out;
  }

  // The work of a sphere is its contacts.
  void spread() {
    std::vector<int> numbers;
    std::vector<Vector3d> centres;
    std::vector<double> weights(own_.size(), 1);
    std::map<int, std::size_t> place;
    for (std::size_t k = 0; k < own_.size(); ++k) {
      numbers.push_back(own_[k].number);
      centres.push_back(own_[k].x);
      place[own_[k].number] = k;
    }
    for (const tc::PointContact& c : share_.contacts) ++weights[place.at(c.first)];
    own_ = unpacked(
        tcm::send(comm_, kNumbers, packed(own_), tcm::partition(comm_, numbers, centres, weights)));
  }

  // Copies go to ranks whose own spheres have a box that is near.
  void copy_near() {
    Eigen::AlignedBox3d box;
    for (const Sphere& s : own_) box.extend(s.x);
    std::vector<Eigen::AlignedBox3d> boxes(static_cast<std::size_t>(ranks_));
    MPI_Allgather(&box, sizeof(box), MPI_BYTE, boxes.data(), sizeof(box), MPI_BYTE, comm_);
    std::vector<Sphere> sent;
    std::vector<int> to;
    constexpr double kNear = 2 * kRadius + kReach;
    for (int r = 0; r < ranks_; ++r) {
      const Eigen::AlignedBox3d& other = boxes[static_cast<std::size_t>(r)];
      if (r == rank_ || other.isEmpty()) continue;
      for (const Sphere& s : own_) {
        if (!(other.squaredExteriorDistance(s.x) <= kNear * kNear)) continue;
        sent.push_back(s);
        to.push_back(r);
      }
    }
    near_ = unpacked(tcm::send(comm_, kNumbers, packed(sent), to));
  }

  // Finds the contacts of the spheres of this rank: with walls, and with those of larger numbers.
  void find_contacts() {
    share_.numbers.clear();
    share_.bodies.clear();
    share_.contacts.clear();
    std::map<std::tuple<int, int, int>, std::vector<const Sphere*>> cells;
    const double cell = 2 * kRadius + kReach;
    const auto index = [&](double x) { return static_cast<int>(std::floor(x / cell)); };
    for (const auto* list : {&own_, &near_})
      for (const Sphere& s : *list)
        cells[{index(s.x[0]), index(s.x[1]), index(s.x[2])}].push_back(&s);
    for (const Sphere& s : own_) {
      share_.numbers.push_back(s.number);
      tc::RigidBody body;
      body.inverse_mass = 1;
      body.inverse_inertia = 2.5 / (kRadius * kRadius) * Eigen::Matrix3d::Identity();
      body.velocity = s.v - Vector3d(0, 0, kStep * kGravity);
      body.angular_velocity = s.w;
      share_.bodies.push_back(body);
      for (int wall = 0; wall < 5; ++wall) {
        const int axis = wall / 2;
        const double side = wall % 2 == 1 ? -1 : 1;
        Vector3d normal = Vector3d::Zero();
        normal[axis == 2 ? 2 : axis] = side;
        const double gap = (side > 0 ? s.x[axis] : width_ - s.x[axis]) - kRadius;
        add(s, -1, normal, gap, static_cast<std::uint64_t>(wall));
      }
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy)
          for (int dz = -1; dz <= 1; ++dz) {
            const auto found =
                cells.find({index(s.x[0]) + dx, index(s.x[1]) + dy, index(s.x[2]) + dz});
            if (found == cells.end()) continue;
            for (const Sphere* other : found->second) {
              if (other->number <= s.number) continue;
              const Vector3d d = s.x - other->x;
              add(s, other->number, d.normalized(), d.norm() - 2 * kRadius,
                  static_cast<std::uint64_t>(other->number) + 5);
            }
          }
    }
  }
  void add(const Sphere& s, int second, const Vector3d& normal, double gap, std::uint64_t id) {
    if (gap > kReach) return;
    tc::PointContact c;
    c.first = s.number;
    c.second = second;
    c.normal = normal;
    c.r1 = -kRadius * normal;
    if (second >= 0) c.r2 = kRadius * normal;
    c.mu = kFriction;
    c.bias = (gap > 0 ? gap : 0.2 * gap) / kStep;  // a fifth of a penetration goes in a step
    c.id = static_cast<std::uint64_t>(s.number) << 32 | id;
    share_.contacts.push_back(c);
  }

  MPI_Comm comm_;
  tcm::Solver solver_;
  tcm::Solution solution_;
  tcm::Share share_;
  std::vector<Sphere> own_, near_;
  double width_ = 1;
  int ranks_ = 1, rank_ = 0, steps_ = 0;
};

// A piece of each rank, and on the first one the file that names them.
void Heap::write(const std::string& name) const {
  const auto piece = [&](int r) { return name + "_" + std::to_string(r) + ".vtu"; };
  const auto open = [](const std::string& file) {
    std::FILE* out = std::fopen(file.c_str(), "w");
    if (!out) throw std::runtime_error(file + " cannot be written");
    return out;
  };
  std::FILE* out = open(piece(rank_));
  const std::size_t n = own_.size();
  std::fprintf(out,
               "<VTKFile type=\"UnstructuredGrid\">\n<UnstructuredGrid><Piece "
               "NumberOfPoints=\"%zu\" NumberOfCells=\"0\">\n<PointData><DataArray "
               "type=\"Int32\" Name=\"rank\" format=\"ascii\">",
               n);
  for (std::size_t k = 0; k < n; ++k) std::fprintf(out, "%d ", rank_);
  std::fprintf(out,
               "</DataArray></PointData>\n<Points><DataArray type=\"Float64\" "
               "NumberOfComponents=\"3\" format=\"ascii\">\n");
  for (const Sphere& s : own_) std::fprintf(out, "%.9g %.9g %.9g\n", s.x[0], s.x[1], s.x[2]);
  std::fprintf(out,
               "</DataArray></Points>\n<Cells><DataArray type=\"Int32\" Name=\"connectivity\"/>"
               "<DataArray type=\"Int32\" Name=\"offsets\"/><DataArray type=\"UInt8\" "
               "Name=\"types\"/></Cells>\n</Piece></UnstructuredGrid></VTKFile>\n");
  std::fclose(out);
  if (rank_ != 0) return;
  out = open(name + ".pvtu");
  std::fprintf(out,
               "<VTKFile type=\"PUnstructuredGrid\">\n<PUnstructuredGrid GhostLevel=\"0\">\n"
               "<PPointData><PDataArray type=\"Int32\" Name=\"rank\"/></PPointData>\n<PPoints>"
               "<PDataArray type=\"Float64\" NumberOfComponents=\"3\"/></PPoints>\n");
  for (int r = 0; r < ranks_; ++r) {
    const std::string file = piece(r);
    std::fprintf(out, "<Piece Source=\"%s\"/>\n", file.substr(file.find_last_of('/') + 1).c_str());
  }
  std::fprintf(out, "</PUnstructuredGrid></VTKFile>\n");
  std::fclose(out);
}

int run(int argc, char** argv) {
  const Settings s = settings(argc, argv);
  Heap heap(MPI_COMM_WORLD, s);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  for (int k = 0; k < s.steps; ++k) {
    heap.step();
    if (rank != 0 || (k + 1) % std::max(1, s.steps / 5) != 0) continue;
    const tcm::Solution& r = heap.solution();
    std::printf(
        "step %4d: %3d sweeps, residual %.1e, %d islands (%d of several ranks); this rank: "
        "%zu spheres, %d contacts, %lld messages\n",
        k + 1, r.sweeps, r.error, r.islands, r.shared_islands, heap.spheres(), r.swept_contacts,
        r.traffic.messages);
  }
  const std::uint64_t hash = heap.hash();
  if (rank == 0)
    std::printf("state after %d steps: %016llx\n", s.steps, static_cast<unsigned long long>(hash));
  std::exception_ptr failure;
  try {
    if (!s.pictures.empty()) heap.write(s.pictures);
  } catch (...) {
    failure = std::current_exception();
  }
  tcm::agree(MPI_COMM_WORLD, failure);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int result = 1, rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  try {
    result = run(argc, argv);
  } catch (const std::exception& e) {
    if (rank == 0) std::fprintf(stderr, "example_ranks_heap: %s\n", e.what());  // the same on all
  }
  MPI_Finalize();
  return result;
}
