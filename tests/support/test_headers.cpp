// Owner of the headers that tests share compiled; see tests/CMakeLists.txt.
// SPDX-License-Identifier: BSD-3-Clause
