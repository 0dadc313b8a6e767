// Tether: a host whose numbers have a decimal comma. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <clocale>
#include <cstdlib>
#include <filesystem>
#include <locale>
#include <string>

namespace tether::test {

/// While it lives, C++ streams write 1.234,5, and so do printf and its kind where C has such a
/// locale, or makes one (localedef).
class CommaLocale {
 public:
  CommaLocale() {
    for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "de_DE", "fr_FR.UTF-8", "fr_FR.utf8"})
      of_c_ = of_c_ || std::setlocale(LC_ALL, name) != nullptr;
    of_c_ = of_c_ || make();
    std::locale::global(std::locale(std::locale::classic(), new Comma));
  }
  ~CommaLocale() {
    std::locale::global(std::locale::classic());
    std::setlocale(LC_ALL, "C");
  }
  CommaLocale(const CommaLocale&) = delete;
  CommaLocale& operator=(const CommaLocale&) = delete;
  bool of_c() const { return of_c_; }

 private:
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };

  // In the folder of the test, under a name of its own until it is whole.
  static bool make() {
    namespace fs = std::filesystem;
    const fs::path folder = fs::absolute("comma_locale"), there = folder / "de_DE.UTF-8";
    std::error_code ignored;
    if (!fs::exists(there)) {
      const fs::path fresh = folder / ("de_DE." + std::to_string(getpid()));
      fs::create_directories(folder, ignored);
      if (std::system(("localedef -c -i de_DE -f UTF-8 '" + fresh.string() + "' >/dev/null 2>&1")
                          .c_str()) != 0)
        return false;
      fs::rename(fresh, there, ignored);
      if (!fs::exists(there)) return false;
    }
    setenv("LOCPATH", folder.c_str(), 1);
    return std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
  }

  bool of_c_ = false;
};

}  // namespace tether::test
