// Tether: contact problems in files. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/contact/cones.hpp>
#include <tether/contact/problem.hpp>
#include <tether/export.hpp>

TETHER_EXPORT_BEGIN
namespace tether::contact {

/// Readers go by the first bytes of a file and throw std::runtime_error with its name and what is
/// wrong with it: missing, truncated, oversized, not finite, sizes that do not match. Files hold
/// q = -b and W = A.
///
/// Siconos .dat: dense (storage 0), block-sparse (1) and sparse (2, as CSparse prints triplets or
/// columns; six digits). fclib HDF5, where the library was built with HDF5: triplets, compressed
/// columns, compressed rows.
///
/// Local problems of dimension 2 and 3, without joints.
Problem read_problem(const std::string& path);
/// The same and more: .dat of dimension 5 (with rolling friction) and global ones (M, H); fclib
/// files with joints (V, R; G), global ones, and global ones with rolling friction. Rows of joints
/// come last, as one free cone.
ConeProblem read_cones(const std::string& path);

/// How write_dat() stores A: every entry, or the blocks that are not zero.
enum class DatStorage { dense, blocks };
/// Writes a .dat that read_problem() reads back without loss. Throws std::runtime_error where the
/// file cannot be written.
void write_dat(const Problem& problem, const std::string& path,
               DatStorage storage = DatStorage::blocks);
/// The same as an fclib file, with triplets. Throws std::runtime_error as above and without HDF5.
void write_fclib(const Problem& problem, const std::string& path);
/// Whether the library was built with HDF5.
bool has_fclib();

}  // namespace tether::contact
TETHER_EXPORT_END
