// Tether: a wave equation in deal.II whose energy is kept. SPDX-License-Identifier: BSD-3-Clause
//
// u_tt = div grad u - u^3 on the square (-1, 1)^2, u = 0 on its border, Q2 elements, lumped cubic:
//
//   F1 = u' - v                                    E = (v.M v + u.K u) / 2 + sum_i m_i u_i^4 / 4
//   F2 = M v' + K u + m u^3
//
// by deal.II's SUNDIALS::IDA, whose damping costs energy, and with one call replaced, which keeps
// it.
#include <cmath>
#include <cstdio>
#include <deal.II/dofs/dof_handler.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/grid/grid_generator.h>
#include <deal.II/grid/tria.h>
#include <deal.II/lac/affine_constraints.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/sparse_direct.h>
#include <deal.II/lac/sparse_matrix.h>
#include <deal.II/numerics/matrix_tools.h>
#include <deal.II/numerics/vector_tools.h>
#include <exception>
#include <tether/ida_projection/deal_ii.hpp>

namespace {

using dealii::BlockVector;
using dealii::SparseMatrix;
using dealii::Vector;
using Ida = dealii::SUNDIALS::IDA<BlockVector<double>>;

class Waves {
 public:
  Waves() : dofs_(grid_) {
    dealii::GridGenerator::hyper_cube(grid_, -1, 1);
    grid_.refine_global(3);
    dofs_.distribute_dofs(dealii::FE_Q<2>(2));
    const dealii::QGauss<2> rule(3);
    dealii::DynamicSparsityPattern entries(dofs_.n_dofs());
    dealii::DoFTools::make_sparsity_pattern(dofs_, entries);
    pattern_.copy_from(entries);
    for (SparseMatrix<double>* matrix : {&mass_, &stiffness_, &newton_}) matrix->reinit(pattern_);
    dealii::MatrixCreator::create_mass_matrix(dofs_, rule, mass_);
    dealii::MatrixCreator::create_laplace_matrix(dofs_, rule, stiffness_);
    lumped_.reinit(dofs_.n_dofs());
    Vector<double> ones(dofs_.n_dofs());
    ones = 1;
    mass_.vmult(lumped_, ones);
    border_ = dealii::DoFTools::extract_boundary_dofs(dofs_);
  }

  BlockVector<double> start() const {
    BlockVector<double> y(2, dofs_.n_dofs());
    dealii::VectorTools::interpolate(
        dofs_, dealii::ScalarFunctionFromFunctionObject<2>([](const dealii::Point<2>& p) {
          return 4 * std::cos(M_PI / 2 * p[0]) * std::cos(M_PI / 2 * p[1]) * (1 + 0.5 * p[0]);
        }),
        y.block(0));
    for (const auto i : border_) y.block(0)[i] = 0;
    return y;
  }

  double energy(const BlockVector<double>& y) const {
    double quartic = 0;
    for (unsigned int i = 0; i < lumped_.size(); ++i)
      quartic += lumped_[i] * std::pow(y.block(0)[i], 4);
    return (mass_.matrix_norm_square(y.block(1)) + stiffness_.matrix_norm_square(y.block(0))) / 2 +
           quartic / 4;
  }
  void energy_gradient(const BlockVector<double>& y, BlockVector<double>& gradient) const {
    stiffness_.vmult(gradient.block(0), y.block(0));
    for (unsigned int i = 0; i < lumped_.size(); ++i)
      gradient.block(0)[i] += lumped_[i] * std::pow(y.block(0)[i], 3);
    mass_.vmult(gradient.block(1), y.block(1));
    // Both blocks stay at rest on the border.
    for (const auto i : border_) gradient.block(0)[i] = gradient.block(1)[i] = 0;
  }

  // v' at the start: M v' = -K u - m u^3.
  void acceleration(const BlockVector<double>& y, BlockVector<double>& rate) {
    prepare(y, 0);
    Vector<double> force(dofs_.n_dofs());
    stiffness_.vmult(force, y.block(0));
    for (unsigned int i = 0; i < lumped_.size(); ++i)
      force[i] = -force[i] - lumped_[i] * std::pow(y.block(0)[i], 3);
    for (const auto i : border_) force[i] = 0;
    rate.block(0) = y.block(1);
    factor_.vmult(rate.block(1), force);
  }

  void connect(Ida& ida) {
    ida.reinit_vector = [this](BlockVector<double>& y) { y.reinit(2, dofs_.n_dofs()); };
    ida.residual = [this](double, const BlockVector<double>& y, const BlockVector<double>& rate,
                          BlockVector<double>& r) {
      r.block(0) = rate.block(0);
      r.block(0) -= y.block(1);
      mass_.vmult(r.block(1), rate.block(1));
      stiffness_.vmult_add(r.block(1), y.block(0));
      for (unsigned int i = 0; i < lumped_.size(); ++i)
        r.block(1)[i] += lumped_[i] * std::pow(y.block(0)[i], 3);
      for (const auto i : border_) r.block(1)[i] = rate.block(1)[i];
      return 0;
    };
    // [alpha, -1; K + 3 m u^2, alpha M]: u from (alpha^2 M + K + 3 m u^2) u = r2 + alpha M r1.
    ida.setup_jacobian = [this](double, const BlockVector<double>& y, const BlockVector<double>&,
                                double alpha) {
      alpha_ = alpha;
      prepare(y, alpha);
      return 0;
    };
    ida.solve_with_jacobian = [this](const BlockVector<double>& r, BlockVector<double>& x, double) {
      Vector<double> right(dofs_.n_dofs());
      mass_.vmult(right, r.block(0));
      right *= alpha_;
      right += r.block(1);
      for (const auto i : border_) right[i] = 0;
      factor_.vmult(x.block(0), right);
      x.block(1) = x.block(0);
      x.block(1) *= alpha_;
      x.block(1) -= r.block(0);
      for (const auto i : border_) {  // v' = r2, u' = v + r1 there
        x.block(1)[i] = r.block(1)[i] / alpha_;
        x.block(0)[i] = (r.block(0)[i] + x.block(1)[i]) / alpha_;
      }
      return 0;
    };
    ida.differential_components = [this] { return dealii::complete_index_set(2 * dofs_.n_dofs()); };
  }

 private:
  // alpha^2 M + K + 3 m u^2, or M for alpha = 0; ones on the border.
  void prepare(const BlockVector<double>& y, double alpha) {
    newton_ = 0;
    newton_.add(alpha == 0 ? 1 : alpha * alpha, mass_);
    if (alpha != 0) {
      newton_.add(1, stiffness_);
      for (unsigned int i = 0; i < lumped_.size(); ++i)
        newton_.add(i, i, 3 * lumped_[i] * y.block(0)[i] * y.block(0)[i]);
    }
    for (const auto i : border_)
      for (auto entry = newton_.begin(i); entry != newton_.end(i); ++entry)
        entry->value() = entry->column() == i ? 1 : 0;
    factor_.initialize(newton_);
  }

  dealii::Triangulation<2> grid_;
  dealii::DoFHandler<2> dofs_;
  dealii::SparsityPattern pattern_;
  SparseMatrix<double> mass_, stiffness_, newton_;
  Vector<double> lumped_;
  dealii::IndexSet border_;
  dealii::SparseDirectUMFPACK factor_;
  double alpha_ = 0;
};

// Largest change of the energy over all outputs, relative to the energy.
double run(Waves& waves, bool keep_energy) {
  Ida::AdditionalData settings;
  settings.final_time = 40;
  settings.output_period = 0.1;
  settings.initial_step_size = 1e-4;
  settings.absolute_tolerance = settings.relative_tolerance = 1e-3;
  settings.ic_type = settings.reset_type = Ida::AdditionalData::none;
  settings.ignore_algebraic_terms_for_errors = false;
  Ida ida(settings);
  waves.connect(ida);

  BlockVector<double> y = waves.start(), rate = y;
  waves.acceleration(y, rate);
  const double energy = waves.energy(y);
  double change = 0;
  ida.output_step = [&](double, const BlockVector<double>& now, const BlockVector<double>&,
                        unsigned int) {
    change = std::max(change, std::abs(waves.energy(now) - energy) / energy);
  };
  if (!keep_energy) {
    ida.solve_dae(y, rate);
    std::printf("as it is:    energy changes by %.1e of itself\n", change);
    return change;
  }
  tether::ida_projection::deal_ii::Rows<BlockVector<double>> rows;
  rows.count = 1;
  rows.names = {"energy"};
  rows.value = [&](double, const BlockVector<double>& now, std::vector<double>& g) {
    g[0] = waves.energy(now) - energy;
  };
  rows.gradient = [&](double, int, const BlockVector<double>& now, BlockVector<double>& gradient) {
    waves.energy_gradient(now, gradient);
  };
  const auto done = tether::ida_projection::deal_ii::solve_dae(ida, rows, y, rate);
  std::printf("energy kept: energy changes by %.1e of itself, %ld projections\n", change,
              done.statistics.projections);
  return change;
}

}  // namespace

int main() {
  try {
    Waves waves;
    const double plain = run(waves, false), kept = run(waves, true);
    return kept < 1e-10 && kept < plain ? 0 : 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 2;
  }
}
