# Scenes moved by the `tether` program, in which all effects are linked: which code of effects that
# they do not name runs? SPDX-License-Identifier: BSD-3-Clause
cmake_minimum_required(VERSION 3.23)
include(${CMAKE_CURRENT_LIST_DIR}/callgrind.cmake)
need_valgrind()

set(start [==[
[scene]
end = 0.01
gravity = [1, 0, -9.81]
[[body]]
name = "ground"
shape = "plane"
fixed = true
material = "ground"
[[body]]
name = "cart"
shape = "box"
size = [1.4, 0.4, 0.2]
mass = 10
position = [0, 0, 0.4]
[[body]]
name = "wheel"
shape = "sphere"
radius = 0.2
mass = 1
position = [0.5, 0, 0.2]
material = "wheel"
]==])
set(axle [==[
[[joint]]
kind = "hinge"
bodies = ["wheel", "cart"]
at = [0.5, 0, 0.2]
axis = [0, 1, 0]
]==])
set(floor [==[
[[pair]]
between = ["wheel", "ground"]
friction = 0.3
]==])
set(steps "[stepping]\nstep = 1e-3\n")
set(forces [==[
[[body]]
name = "vane"
mass = 1
inertia = [1, 1, 1]
position = [0, 5, 0]
drag = { linear = 0.1 }
[[spring]]
bodies = ["wheel", "cart"]
at = [[0.5, 0, 0.2], [0.5, 0, 0.4]]
stiffness = 100
[[load]]
body = "wheel"
force = [0, 1, 0]
[[central_gravity]]
at = [9, 9, 9]
gravitational_parameter = 1
]==])
set(laws "limits_deg = [-90, 10]\nmotor = { rate_deg = 10, torque = 2 }\nfriction = 0.1\n")

# ran(<name> <scene> <result>): functions of the project that the run executes.
function(ran name scene result)
  file(WRITE ${WORK}/${name}.toml "${scene}")
  count(COMMAND ${PROGRAM} run ${WORK}/${name}.toml --quiet TOGGLE "tether::scene::run*"
    FUNCTIONS functions)
  list(FILTER functions INCLUDE REGEX "^tether::")
  set(${result} "${functions}" PARENT_SCOPE)
endfunction()

# Functions that move bodies or laws: an effect that a scene does not name is not made, and its law not asked.
set(words CentralGravityForce:: DragForce:: LoadForce:: SpringForces:: JointFrictionEffect::add_laws
  JointLimitEffect::add_laws JointMotorEffect::add_laws LawRows::start detail::Restitution:: ::check_friction)

ran(with_forces "${start}${axle}${laws}${floor}restitution = 0.5\n${forces}${steps}" all)
ran(with_rolling "${start}${floor}rolling = 0.01\n${steps}" rolling)
foreach(word IN LISTS words)
  if(NOT "${all};${rolling}" MATCHES "${word}")
    message(SEND_ERROR "${word} is not seen where it is named: nothing is shown")
  endif()
endforeach()

ran(cart_in_steps "${start}${axle}${floor}${steps}" cart)
ran(wheel_in_steps "${start}${floor}${steps}" wheel)
ran(wheel_with_events "${start}${floor}[event]\ntolerance = 1e-6\n" events)
ran(cart_with_events "${start}${axle}${floor}[event]\ntolerance = 1e-6\n" cart_events)
string(REPLACE "material = \"wheel\"" "" alone "${start}")
ran(cart_smooth "${alone}${axle}" smooth)
foreach(scene IN ITEMS cart wheel events cart_events smooth)
  foreach(word IN LISTS words)
    if("${${scene}}" MATCHES "${word}")
      message(SEND_ERROR "${scene}: ${word} runs though the scene does not name it")
    endif()
  endforeach()
endforeach()
message("no code of effects that are not named, in five scenes")
