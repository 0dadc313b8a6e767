// Tether: meshes and height fields of a scene file. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "toml/fields.hpp"

namespace tether::scene::files {

/// shape = "mesh": points and triangles, or a file.
void read_mesh(Fields& in, Reader& r, Shape& shape);
/// The convex parts of the mesh of a body that moves; none where it bounds no solid.
std::vector<Shape> read_parts(Fields& in, Reader& r, const Shape& mesh);
/// shape = "height_field", a mesh as well: heights, or a file, and their spacing.
void read_height_field(Fields& in, Reader& r, Shape& shape);

}  // namespace tether::scene::files
