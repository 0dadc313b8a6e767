// Tether: for code in documents that stands alone. SPDX-License-Identifier: BSD-3-Clause
#pragma once
