# Scenes without contacts, moved by the `tether` program: which code of the contact library runs?
# SPDX-License-Identifier: BSD-3-Clause
cmake_minimum_required(VERSION 3.23)
include(${CMAKE_CURRENT_LIST_DIR}/callgrind.cmake)
need_valgrind()

set(body [==[
[scene]
end = 0.01
gravity = [0, 0, -9.81]
[[body]]
name = "rod"
shape = "box"
size = [1, 0.1, 0.1]
mass = 1
angular_velocity = [1, 0, 0]
]==])
set(joint [==[
[[joint]]
kind = "ball"
bodies = ["rod", "world"]
at = [0.5, 0, 0]
]==])

# contact_code(<name> <scene> <result>): functions of the library that the run executes.
function(contact_code name scene result)
  file(WRITE ${WORK}/${name}.toml "${scene}")
  count(COMMAND ${PROGRAM} run ${WORK}/${name}.toml --quiet TOGGLE "tether::scene::run*"
    FUNCTIONS functions)
  list(FILTER functions INCLUDE REGEX "tether::contact::")
  # Shapes are data of the scene: the standard library's copies of them are no code of contacts.
  list(FILTER functions EXCLUDE REGEX "^[^(]*std::.*tether::contact::Shape|^tether::contact::Shape::(Shape|~Shape)")
  set(${result} "${functions}" PARENT_SCOPE)
endfunction()

contact_code(smooth "${body}${joint}" ran)
if(ran)
  message(SEND_ERROR "the smooth engine executes contact code: ${ran}")
endif()

# The stepping engine is part of the contact library; contacts are not part of its step.
contact_code(stepping "${body}[stepping]\nstep = 1e-3\n" ran)
if(NOT ran MATCHES "Stepper::step")
  message(SEND_ERROR "no step was seen")
endif()
list(FILTER ran INCLUDE REGEX
  "NearContacts|Broadphase|BodySolver|ContactGraph|ImpulseMemory|WorkerTeam|Restitution|collide|sweep|solve_contacts|find_contacts|correct_penetration")
if(ran)
  message(SEND_ERROR "without contacts these run: ${ran}")
endif()
message("no code of contacts")
