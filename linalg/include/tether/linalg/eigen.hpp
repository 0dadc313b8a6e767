// Tether: Eigen types that cross the border between a program and the installed libraries.
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>

namespace tether::linalg {

/// Eigen aligns to the widest vector register that the compiler may use. -mavx turns the alignment
/// of Eigen::Quaterniond, of fixed matrices of 32 bytes and of everything on the heap from 16 into
/// 32 bytes. With it change the layout of structures and the way in which memory is freed. A
/// program and a library compiled with different flags must not own such objects together.
///
/// Public headers therefore hold these types. They are not aligned (Eigen::DontAlign: memory from
/// malloc, whatever the flags), convert from and to Eigen's own types, and are as fast where
/// unaligned loads are. Eigen::Vector3d (24 bytes) and Matrix3d (72) are never aligned.
template <int Rows, int Columns>
using Matrix = Eigen::Matrix<double, Rows, Columns, Eigen::ColMajor | Eigen::DontAlign>;
/// A matrix of any size.
using MatrixX = Matrix<Eigen::Dynamic, Eigen::Dynamic>;
/// A column of any length.
using VectorX = Matrix<Eigen::Dynamic, 1>;
/// x, y, z, w in memory.
using Quaternion = Eigen::Quaternion<double, Eigen::DontAlign>;

/// Arguments: any Eigen vector or matrix of doubles. An expression is evaluated by the caller; what
/// already lies in memory with contiguous columns is not copied.
using VectorView = Eigen::Ref<const VectorX>;
/// The same for matrices.
using MatrixView = Eigen::Ref<const MatrixX, 0, Eigen::OuterStride<>>;

static_assert(sizeof(Eigen::Index) == sizeof(std::ptrdiff_t),
              "Tether was compiled with Eigen's own EIGEN_DEFAULT_DENSE_INDEX_TYPE");
static_assert(!Eigen::Matrix3d::IsRowMajor,
              "Tether was compiled without EIGEN_DEFAULT_TO_ROW_MAJOR");
static_assert(sizeof(Quaternion) == 4 * sizeof(double) && alignof(Quaternion) == alignof(double) &&
                  sizeof(Eigen::Vector3d) == 3 * sizeof(double) &&
                  alignof(Eigen::Vector3d) == alignof(double) &&
                  sizeof(Eigen::Matrix3d) == 9 * sizeof(double) &&
                  alignof(Eigen::Matrix3d) == alignof(double),
              "a macro of Eigen changes the layout of what Tether's headers hold");

}  // namespace tether::linalg
