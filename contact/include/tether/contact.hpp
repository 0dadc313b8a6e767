// Tether: everything of the contact library. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/contact/bodies.hpp>
#include <tether/contact/body_solver.hpp>
#include <tether/contact/cones.hpp>
#include <tether/contact/derivative.hpp>
#include <tether/contact/evaluate.hpp>
#include <tether/contact/joints.hpp>
#include <tether/contact/one_contact.hpp>
#include <tether/contact/problem.hpp>
#include <tether/contact/proof.hpp>
#include <tether/contact/shapes.hpp>
#include <tether/contact/solver.hpp>
#include <tether/contact/stepping.hpp>

/// Contact with friction: problems, their solvers and errors, and bodies in motion. SI units.
namespace tether::contact {}
