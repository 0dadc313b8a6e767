// Tether: judges a certificate by the laws of mechanics. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <tether/export.hpp>
#include <vector>

TETHER_EXPORT_BEGIN
namespace tether::scene::certificate {

/// The outcome of a judgement.
struct Verdict {
  std::string damage;               ///< why it cannot be judged; empty: it was
  std::vector<std::string> faults;  ///< laws that are broken, the first ones
  long broken = 0, judged = 0;      ///< numbers of them, and of judgements
};

/// Judges a file line by line by what it says, whatever it holds.
Verdict judge(const std::string& file);

}  // namespace tether::scene::certificate
TETHER_EXPORT_END
