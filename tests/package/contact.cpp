// Smallest user of tether::contact. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact.hpp>

int main() { return 0; }
