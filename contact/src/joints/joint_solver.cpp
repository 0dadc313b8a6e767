// Tether: joints and contacts in one solve. SPDX-License-Identifier: BSD-3-Clause
#include <tether/contact/joints.hpp>

#include <string>
#include <utility>

#include "joints/jointed_contacts.hpp"
#include "joints/mechanisms.hpp"
#include "problem/refuse.hpp"

namespace tether::contact {

struct JointSolver::Implementation {
  explicit Implementation(const Options& options) : contacts(options) {}
  detail::Mechanisms mechanisms;
  detail::JointedContacts contacts;
};

JointSolver::JointSolver(const Options& options)
    : implementation_(std::make_unique<Implementation>(options)) {}
JointSolver::~JointSolver() = default;
JointSolver::JointSolver(JointSolver&&) noexcept = default;
JointSolver& JointSolver::operator=(JointSolver&&) noexcept = default;

namespace {

std::string advice(const JointSolution& s) {
  const auto list = [](const std::vector<int>& numbers) {
    std::string text;
    for (const int n : numbers) text += (text.empty() ? " " : ", ") + std::to_string(n);
    return text;
  };
  if (!s.contradicting.empty())
    return "joints" + list(s.contradicting) +
           " contradict each other: no velocities have all their rates; leave one of them out, or "
           "give it a compliance";
  if (!s.blocked.empty())
    return "the joints hold the bodies of contacts" + list(s.blocked) +
           " together though they approach: a prescribed motion drives them into each other";
  return {};
}

}  // namespace

JointSolution JointSolver::solve(const std::vector<RigidBody>& bodies, const JointRows& joints,
                                 const std::vector<ContactRows>& contacts) {
  detail::check(bodies, contacts);
  const auto moves = [&](int body) {
    return body >= 0 && bodies[static_cast<std::size_t>(body)].moves();
  };
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (!moves(contacts[i].first) && !moves(contacts[i].second)) detail::refuse_fixed(i);
  detail::Mechanisms& mechanisms = implementation_->mechanisms;
  mechanisms.update(bodies, joints);
  mechanisms.clear_pulls();
  JointSolution out;
  out.velocities.reserve(bodies.size());
  for (const RigidBody& body : bodies) out.velocities.push_back(body.velocities());
  mechanisms.satisfy(joints, out.velocities);
  out.contradicting = mechanisms.contradicting();

  out.impulses.setZero(3 * static_cast<Eigen::Index>(contacts.size()));
  const detail::JointedContacts::Result& result =
      implementation_->contacts.solve(mechanisms, contacts, {}, out.velocities, out.impulses);
  if (!contacts.empty()) mechanisms.satisfy(joints, out.velocities);  // remove rounding errors
  out.joint_error = mechanisms.error(joints, out.velocities);
  out.joint_impulses.setZero(joints.count());
  mechanisms.impulses(out.joint_impulses.data());
  out.status = out.contradicting.empty() ? result.status : Status::infeasible;
  out.error = result.error;
  out.blocked = result.blocked;
  out.islands = result.islands;
  out.counts = result.counts;
  out.advice = advice(out);
  if (out.advice.empty()) out.advice = result.advice;
  return out;
}

}  // namespace tether::contact
