// Tether: text for terminals and tables. SPDX-License-Identifier: BSD-3-Clause
//
// Names of files are those of whoever made the folder: *.toml may hold what a terminal obeys.
#pragma once

#include <string>
#include <string_view>

namespace tether::scene {

/// Lines without what a terminal obeys (files::printable).
std::string on_terminal(std::string_view text);

/// A field of CSV: quoted where it has to be; control characters become blanks.
std::string table_field(std::string_view text);

}  // namespace tether::scene
