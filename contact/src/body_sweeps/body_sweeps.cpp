// Tether: sweeps over an island, with momentum. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "body_sweeps/assembly_price.hpp"
#include "body_sweeps/body_parts.hpp"

namespace tether::contact {

namespace {

// Forecasts of the sweeps that are still needed are made after 5, 10, 20, 40, ... sweeps. More than
// kSlow: momentum is used. More than assembly and solution are predicted to cost, after sweeps for
// kTried of that: assembled.
constexpr int kFirstForecast = 5;
constexpr int kFew = 64;  // see BodyOptions::min_sweeps
constexpr double kSlow = 15, kTried = 0.25;
constexpr detail::BodyInertia kNoInertia = {};

// Nesterov's momentum on the sweeps. A sweep is no gradient step, but the same rule serves: where a
// sweep changes more than the one before, the momentum is dropped and its growth set back by half.
// Where contacts toggle between stick and slip that happens all the time: as long as it does not
// get on, a little more change is allowed in every other window.
class Momentum {
 public:
  void start() { on_ = true; }
  bool on() const { return on_; }
  // beta, given the sum of squares that the last sweep changed.
  double next(double change) {
    best_ = std::min(best_, change);
    if (++count_ == window_end_) look_back();
    const double grown = 0.5 * (1 + std::sqrt(1 + 4 * t_ * t_));
    double beta = (t_ - 1) / grown;
    if (change > allowed_ * last_) {
      t_ = std::max(1.0, 0.5 * t_);
      beta = 0;
    } else {
      t_ = grown;
    }
    last_ = change;
    return beta;
  }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();

  void look_back() {
    if (best_ > 0.25 * best_before_) {  // of squares: not halved
      allowed_ = allowed_ > 1 ? 1 : 1.2;
      t_ = 1;
      last_ = kNone;
    }
    best_before_ = best_;
    window_ += window_ / 2;
    window_end_ = count_ + window_;
  }

  bool on_ = false;
  double t_ = 1, last_ = kNone, allowed_ = 1, best_ = kNone, best_before_ = kNone;
  int count_ = 0, window_ = 100, window_end_ = 100;
};

// The best point of an island that may never be solved. Residuals of earlier points cost a pass
// each: they are looked at where a sweep changes clearly less than at the last look or that is long
// ago, and only where the forecast passes max_sweeps, half of them are gone, or changes begin to
// rise in a long run.
class BestPoint {
 public:
  static constexpr int kFirst = 64;  // sweeps before the first look

  explicit BestPoint(int max_sweeps) : max_sweeps_(max_sweeps) {}
  void want() { wanted_ = true; }
  void forecast(double sweeps) { slow_ = !(sweeps <= max_sweeps_); }
  // change: sum of squares that the last sweep changed.
  bool look(int sweeps, double change) {
    const bool rises = change > last_ && sweeps >= kLong;
    last_ = change;
    if (!wanted_ || sweeps < next_) return false;
    if (!(change < kLess * change_) && sweeps < next_ + kOld) return false;
    if (!rises && !slow_ && sweeps <= max_sweeps_ / 2) return false;
    change_ = change;
    next_ = sweeps + kApart;
    return true;
  }
  // residual: a sum of squares too. True: the point is to be saved.
  bool improved(double residual) {
    if (!(residual < residual_)) return false;
    residual_ = residual;
    return true;
  }
  // False where the residual of the last point is not a number, unless nothing was saved.
  bool last_is_best(double residual) const { return !(residual_ < kNone) || residual <= residual_; }
  double residual() const { return residual_; }

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  static constexpr int kApart = 8, kLong = 256, kOld = 120;
  static constexpr double kLess = 0.64;

  bool wanted_ = false, slow_ = false;
  int max_sweeps_, next_ = kFirst;
  double change_ = kNone, last_ = kNone, residual_ = kNone;
};

}  // namespace

// operation(bodies, begin, end, theta of these contacts)
template <class Operation>
detail::PassResult BodySolver::Implementation::over_kinds(int chunk, const Team& team,
                                                          const Operation& operation) {
  const BodyArrays s{state.data(), inertia.data(), fixed.data(), &team.worker->nowhere,
                     &kNoInertia};
  const auto &from = graph.chunks[at(chunk)].begin, &to = graph.chunks[at(chunk + 1)].begin;
  PassResult sum;
  Coupled coupled = graph.coupled.data() + graph.chunks[at(chunk)].place;
  const auto kind_range = [&](auto& list, Kind k, int width) {
    const int begin = from[static_cast<int>(k)] / width, end = to[static_cast<int>(k)] / width;
    if (begin < end) sum.add(operation(s, list.data() + begin, list.data() + end, coupled));
    coupled += width * (end - begin);
  };
  kind_range(general4, Kind::general4, 4);
  kind_range(spheres4, Kind::sphere4, 4);
  kind_range(general, Kind::general, 1);
  kind_range(spheres, Kind::sphere, 1);
  kind_range(smooth, Kind::smooth, 1);
  return sum;
}

detail::PassResult BodySolver::Implementation::sweep(int chunk, const Team& team) {
  return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end, Coupled) {
    return detail::sweep(s, options.law, begin, end);
  });
}

detail::PassResult BodySolver::Implementation::test(int chunk, const Team& team) {
  return over_kinds(chunk, team, [&](const BodyArrays& s, auto* begin, auto* end, Coupled coupled) {
    return detail::test(s, options.law, begin, end, coupled);
  });
}

// The first chunk of part k of `parts` with about the same number of contacts.
int BodySolver::Implementation::cut(int begin, int end, int k, int parts) const {
  if (k == 0) return begin;
  if (k == parts) return end;
  const Chunk* chunks = graph.chunks.data();
  const long long first_place = chunks[begin].place;
  const long long place = first_place + (chunks[end].place - first_place) * k / parts;
  const Chunk* c = std::partition_point(chunks + begin, chunks + end, [&](const Chunk& chunk) {
    return static_cast<long long>(chunk.place) + (&chunk)[1].place < 2 * place;
  });
  return static_cast<int>(c - chunks);
}

// x <- x + beta (x - previous x) and the same for the velocities, which follow x linearly.
void BodySolver::Implementation::extrapolate(const Island& island, const Team& team, double beta) {
  const auto move = [beta](double& x, double& previous) {
    const double now = x;
    x += beta * (now - previous);
    previous = now;
  };
  const int begin = team.from(island.chunk_begin, island.chunk_end);
  const int end = team.to(island.chunk_begin, island.chunk_end);
  for (int chunk = begin; chunk < end; ++chunk) {
    double* previous = previous_impulse.data() + 3 * at(graph.chunks[at(chunk)].place);
    const auto &from = graph.chunks[at(chunk)].begin, &to = graph.chunks[at(chunk + 1)].begin;
    const auto over = [&](auto& list, Kind k, int width, auto&& impulses) {
      const int last = to[static_cast<int>(k)] / width;
      for (int i = from[static_cast<int>(k)] / width; i < last; ++i) {
        double* x = impulses(list[at(i)]);
        for (int c = 0; c < 3 * width; ++c) move(x[c], *previous++);
      }
    };
    over(general4, Kind::general4, 4, [](GeneralGroup& g) { return &g.x[0][0]; });
    over(spheres4, Kind::sphere4, 4, [](SphereGroup& g) { return &g.p[0][0]; });
    over(general, Kind::general, 1, [](GeneralContact& c) { return c.x; });
    over(spheres, Kind::sphere, 1, [](SphereContact& c) { return c.p; });
    const int last = to[static_cast<int>(Kind::smooth)];
    for (int i = from[static_cast<int>(Kind::smooth)]; i < last; ++i) {
      move(smooth[at(i)].x, *previous++);
    }
  }
  const int bodies_end = team.to(island.body_begin, island.body_end);
  for (int i = team.from(island.body_begin, island.body_end); i < bodies_end; ++i) {
    double* previous = previous_velocity.data() + 6 * at(i);
    for (int c = 0; c < 3; ++c) {
      move(state[at(i)].v[c], previous[c]);
      move(state[at(i)].w[c], previous[3 + c]);
    }
  }
  team.meet();
}

// To the caller's storage, which takes the last point otherwise. The threads meet before it, since
// one may still add up what the last pass returned, and after it, since the next one moves bodies.
void BodySolver::Implementation::save(const Island& island, const Team& team) {
  team.meet();
  unpack(island, team);
  team.meet();
}

// b = 0: no impulses; those of the last solve are dropped.
void BodySolver::Implementation::rest(const Island& island, const Team& team, int& turn) {
  pass(island, team, turn, [&](int chunk) {
    visit(chunk, [&](int, Kind k, int place) { set_impulse(k, place, Vector3d::Zero()); });
    return PassResult();
  });
  for (int s = team.from(island.body_begin, island.body_end);
       s < team.to(island.body_begin, island.body_end); ++s)
    load_body(s);
  team.meet();
}

// Sweeps until the island is solved, max_sweeps are reached, or it should be assembled.
void BodySolver::Implementation::iterate(int k, const Team& team) {
  const Island& island = graph.islands[at(k)];
  const bool permitted = island.contacts <= options.max_assembled;
  detail::AssemblyPrice price(graph, island, first, second);
  int turn = 0;
  IslandResult r;
  const PassResult b = pass(island, team, turn, [&](int c) { return pack(c, *team.worker); });
  r.inverse_scale = detail::inverse_scale(b.most, b.sum);
  r.floor = detail::round_off(b.speed);
  if (b.sum == 0 && b.most == 0) rest(island, team, turn);
  const double allowed = options.tolerance / r.inverse_scale;
  const double bound = std::max(allowed * allowed, r.floor);
  double earlier = std::numeric_limits<double>::infinity();  // at the last forecast
  int forecast = kFirstForecast, failed_tests = 0;
  int next_test = island.contacts > kFew ? options.min_sweeps : 0;
  Momentum momentum;
  BestPoint best(options.max_sweeps);
  for (;;) {
    const PassResult change = pass(island, team, turn, [&](int c) { return sweep(c, team); });
    const double sum = change.sum;
    ++r.sweeps;
    if (r.sweeps == BestPoint::kFirst && !(permitted && price.within(options.max_work)))
      best.want();
    const bool last = r.sweeps >= options.max_sweeps;
    // The change by a sweep is close to the residual, which would cost another pass.
    if ((change.most <= bound && r.sweeps >= next_test) || island.contacts == 1 || last) {
      double residual = pass(island, team, turn, [&](int c) { return test(c, team); }).most;
      r.saved = last && !best.last_is_best(residual);
      if (r.saved) residual = best.residual();
      r.error = r.relative(residual);
      if (residual <= bound) {
        r.status = Status::solved;
        break;
      }
      next_test = r.sweeps + ++failed_tests;
    } else if (best.look(r.sweeps, change.most) &&
               best.improved(pass(island, team, turn, [&](int c) { return test(c, team); }).most)) {
      save(island, team);
    }
    if (last) {
      r.status = sum > 0.998 * earlier ? Status::cycling : Status::work_limit;
      break;
    }
    if (r.sweeps == forecast) {
      // Linear convergence as since half as many sweeps: how many more?
      const bool known = sum > 0 && std::isfinite(earlier);
      const double rate = known ? std::log(sum / earlier) / (0.5 * r.sweeps) : 0;
      const double more = !known     ? 0
                          : rate < 0 ? std::log(bound / change.most) / rate
                                     : std::numeric_limits<double>::infinity();
      if (r.sweeps > kFirstForecast) {
        if (permitted && momentum.on() && more > r.sweeps / kTried) {
          const double assembly = price.sweeps();
          const bool tried = r.sweeps > kTried * assembly;
          if (tried && more > assembly && price.within(options.max_work)) break;
        }
        if (more > kSlow && !momentum.on()) momentum.start();
      }
      best.forecast(r.sweeps + more);
      earlier = sum;
      forecast *= 2;
    }
    if (momentum.on()) extrapolate(island, team, momentum.next(sum));
  }
  r.assemblable = r.status != Status::solved && permitted && price.within(options.max_work);
  if (team.thread == 0) results[at(k)] = r;
}

}  // namespace tether::contact
