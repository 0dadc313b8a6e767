// Tether: everything of the scene library. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <tether/scene/cost.hpp>
#include <tether/scene/engine.hpp>
#include <tether/scene/files.hpp>
#include <tether/scene/joint.hpp>
#include <tether/scene/plan.hpp>
#include <tether/scene/run.hpp>
#include <tether/scene/scene.hpp>
#include <tether/scene/vary.hpp>
#include <tether/scene/words.hpp>

/// Scenes: files, engines that move them, runs that record and judge. SI units.
namespace tether::scene {}
