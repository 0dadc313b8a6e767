# Instruction counts of steps; see CMakeLists.txt. SPDX-License-Identifier: BSD-3-Clause
cmake_minimum_required(VERSION 3.23)
include(${CMAKE_CURRENT_LIST_DIR}/callgrind.cmake)
need_valgrind()

# Functions in the programs.
function(symbols program result)
  execute_process(COMMAND ${NM} -C ${program} OUTPUT_VARIABLE all COMMAND_ERROR_IS_FATAL ANY)
  set(${result} "${all}" PARENT_SCOPE)
endfunction()
symbols(${MINIMUM} minimum)
symbols(${EVERYTHING} everything)
# Inner loops of friction, the laws and the stages that use them, restitution, joints.
set(effects "anonymous namespace.::body_sweep" "anonymous namespace.::plain_sweep" sweep_spheres "Restitution::limit_energy" "contact_cone"
  "InteriorPoint|interior_point" "left_jacobian|solve_step" "Automatic::at_round_off")
if(WHOLE MATCHES "tether_scene")
  list(APPEND effects "tether::scene::smooth::")
endif()
foreach(effect IN LISTS effects)
  if(minimum MATCHES "${effect}")
    message(SEND_ERROR "${effect} is linked into the minimum")
  endif()
  if(NOT everything MATCHES "${effect}")
    message(SEND_ERROR "${effect} is not linked into the program with everything")
  endif()
endforeach()
foreach(needed IN ITEMS sweep_smooth "Stepper::step" "NearContacts::find")
  if(NOT minimum MATCHES "${needed}")
    message(SEND_ERROR "${needed} is missing from the minimum")
  endif()
endforeach()

# The price of a step.
set(step "tether::contact::Stepper::step()")
count(COMMAND ${MINIMUM} settle TOGGLE ${step} TOTAL least OUTPUT least_said FUNCTIONS ran)
count(COMMAND ${EVERYTHING} settle TOGGLE ${step} TOTAL most OUTPUT most_said)
math(EXPR difference "(${most} - ${least}) * 1000000 / ${least}")
message("settle: ${least} instructions with the minimum, ${most} with everything: ${difference} ppm")
if(difference GREATER 1000 OR difference LESS -1000)
  message(SEND_ERROR "effects that are not named cost instructions")
endif()
if(NOT least_said STREQUAL most_said)
  message(SEND_ERROR "results differ: ${least_said} ${most_said}")
endif()
if(NOT ran MATCHES "sweep_smooth")
  message(SEND_ERROR "the scene has no contacts; nothing is shown")
endif()

# One problem a step, and a second one for positions where gaps close or bodies are deep: 177.7 million. Spheres without
# friction turn by rounding only, so nothing is looked for in the middle of the step.
if(most GREATER 179100000)
  message(SEND_ERROR "settling costs ${most} instructions")
endif()

# An effect without strength: the same result.
count(COMMAND ${EVERYTHING} zero TOGGLE ${step} OUTPUT zero_said)
if(NOT zero_said STREQUAL most_said)
  message(SEND_ERROR "an effect without strength changes the result: ${zero_said} ${most_said}")
endif()

# No contacts: only the loop over the stages, gravity, motion, and whether the lists are as long as the bodies are many and all of it is finite.
count(COMMAND ${EVERYTHING} free TOGGLE ${step} TOTAL free FUNCTIONS functions)
list(FILTER functions INCLUDE REGEX "tether::")
list(FILTER functions EXCLUDE REGEX
  "Stepper::(step|Implementation::(step|check_lengths))|StepHalving::(whole|advance)|SubStepper::(set_now|take|is_finite|make_stages)|FreeMotion::(accelerate|move|turn_round)|detail::exponential")
message("free: ${free} instructions")
if(functions)
  message(SEND_ERROR "without contacts these run: ${functions}")
endif()
