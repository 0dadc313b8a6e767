// Tether: IDA by reverse communication. SPDX-License-Identifier: BSD-3-Clause
#include <boost/context/fiber.hpp>
#include <boost/context/protected_fixedsize_stack.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <functional>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <optional>
#include <stdexcept>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <tether/reverse_ida.hpp>

#include "host/guarded.hpp"
#include "host/owned_vector.hpp"
#include "host/shortest.hpp"

namespace tether::reverse_ida {

namespace {

namespace tp = ida_projection;

constexpr std::size_t kStack = std::size_t{1} << 20;

void free_context(SUNContext context) { SUNContext_Free(&context); }
void free_ida(void* mem) { IDAFree(&mem); }

SUNContext new_context() {
  SUNContext context = nullptr;
#ifdef SUN_COMM_NULL  // SUNDIALS 7
  const int flag = SUNContext_Create(SUN_COMM_NULL, &context);
#else
  const int flag = SUNContext_Create(nullptr, &context);
#endif
  if (flag != 0 || context == nullptr) throw std::bad_alloc();
  return context;
}

template <class Pointer>
Pointer made(Pointer pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

void require(bool right, const std::string& argument, double value, const char* allowed) {
  if (!right)
    throw std::invalid_argument("ReverseIda: " + argument + " = " + tp::shortest(value) +
                                ", must be " + allowed);
}

void check(const Equations& e) {
  const std::size_t n = e.y.size();
  const auto sized = [](bool right, const char* name, std::size_t size, const char* allowed) {
    require(right, std::string(name) + ".size()", static_cast<double>(size), allowed);
  };
  sized(n >= 1, "y", n, "at least 1");
  sized(e.yp.size() == n, "yp", e.yp.size(), "that of y");
  sized(e.atol.size() == 1 || e.atol.size() == n, "atol", e.atol.size(), "1 or that of y");
  sized(e.id.empty() || e.id.size() == n, "id", e.id.size(), "0 or that of y");
  const auto finite = [](const char* name, const std::vector<double>& values) {
    for (std::size_t i = 0; i < values.size(); ++i)
      require(std::isfinite(values[i]), std::string(name) + "[" + std::to_string(i) + "]",
              values[i], "finite");
  };
  finite("y", e.y), finite("yp", e.yp), finite("atol", e.atol), finite("id", e.id);
  require(std::isfinite(e.t0), "t0", e.t0, "finite");
  require(e.rtol >= 0.0 && std::isfinite(e.rtol), "rtol", e.rtol, ">= 0");
  for (const double a : e.atol) require(a >= 0.0, "atol", a, ">= 0");
  require(e.constraints >= 0, "constraints", e.constraints, ">= 0");
  sized(e.names.empty() || e.names.size() == static_cast<std::size_t>(e.constraints), "names",
        e.names.size(), "0 or the number of constraints");
}

}  // namespace

const char* to_string(Request request) {
  static constexpr const char* kNames[] = {
      "reached", "failed", "residual",    "jacobian",
      "setup",   "solve",  "constraints", "constraint_jacobian"};
  const auto i = static_cast<std::size_t>(request);
  return i < std::size(kNames) ? kNames[i] : "unknown";
}

/// IDA and its data, and the fiber in which it runs. A call sets the command, enters the fiber, and
/// returns when a function that IDA has called leaves it with a question, or the command is done.
class ReverseIda::Implementation {
 public:
  explicit Implementation(Equations equations)
      : equations_(std::move(equations)),
        context_(new_context()),
        y_(vector(equations_.y)),
        yp_(vector(equations_.yp)),
        inside_(std::allocator_arg, boost::context::protected_fixedsize_stack(kStack),
                [this](boost::context::fiber&& caller) {
                  outside_ = std::move(caller);
                  run_commands();
                  return std::move(outside_);
                }) {
    mem_.reset(made(IDACreate(context_.get())));
    expect(IDAInit(mem_.get(), residual, equations_.t0, y_.get(), yp_.get()), "IDAInit");
    expect(IDASetUserData(mem_.get(), this), "IDASetUserData");
    std::vector<double> each = equations_.atol;
    each.resize(equations_.y.size(), each.front());
    const tp::Owned<N_Vector, N_VDestroy> atol(vector(each));
    expect(IDASVtolerances(mem_.get(), equations_.rtol, atol.get()), "IDASVtolerances");
    set_linear_solver();
    if (!equations_.id.empty()) {
      id_.reset(vector(equations_.id));
      expect(IDASetId(mem_.get(), id_.get()), "IDASetId");
    }
    if (equations_.constraints > 0) {
      if (id_) equations_.options.id = id_.get();
      equations_.options.print = false;  // message() has it
      projection_.emplace(mem_.get(), constraints(), equations_.options);
    }
    at_rest(Request::reached);
    t_ = equations_.t0;
  }

  /// IDA is led out of the function in which it waits before anything is freed.
  ~Implementation() {
    abandoned_ = true;
    // IDA's errors from here on are this end.
#if SUNDIALS_VERSION_MAJOR < 7
    IDASetErrFile(mem_.get(), nullptr);
#else
    SUNContext_ClearErrHandlers(context_.get());
#endif
    while (started_ && inside_) enter();
  }

  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  Request solve(double tout, bool one_step) {
    const int task = one_step ? IDA_ONE_STEP : IDA_NORMAL;
    return start([this, tout, task] {
      double reached = t_;
      task_.flag = projection_ ? projection_->solve(tout, &reached, y_.get(), yp_.get(), task)
                               : IDASolve(mem_.get(), tout, &reached, y_.get(), yp_.get(), task);
      t_ = reached;
      if (task_.flag < 0) fail();
    });
  }

  Request make_consistent() {
    if (!projection_) throw std::logic_error("ReverseIda: make_consistent() needs constraints");
    return start([this] {
      const tp::ConsistencyReport report =
          projection_->make_consistent(equations_.t0, y_.get(), yp_.get());
      t_ = equations_.t0;
      task_.flag = report ? 0 : -1;
      if (!report) task_.message = report.message.empty() ? "no consistent values" : report.message;
    });
  }

  Request go_on(int answer) {
    if (!asked_.open()) throw std::logic_error("ReverseIda: go_on() without a request");
    asked_.answer = answer;
    return resume();
  }

  // The question to the caller, its place, and the answer; or nothing is open.
  struct Question {
    Request request = Request::reached;
    double t = 0.0, cj = 0.0;
    const double *y = nullptr, *yp = nullptr, *rhs = nullptr;
    double* result = nullptr;
    std::size_t result_size = 0;
    int answer = 0;
    bool open() const { return request != Request::reached && request != Request::failed; }
  };
  // The command that runs in the fiber, and its outcome.
  struct Task {
    std::function<void()> command;
    int flag = 0;
    std::string message = {};
    std::exception_ptr thrown = {};
    bool waiting = false;  // it is done
  };

  N_Vector vector(const std::vector<double>& values) const {
    const N_Vector made_here =
        made(N_VNew_Serial(static_cast<sunindextype>(values.size()), context_.get()));
    std::memcpy(N_VGetArrayPointer(made_here), values.data(), values.size() * sizeof(double));
    return made_here;
  }

  static void expect(int flag, const char* function) {
    if (flag == IDA_MEM_FAIL) throw std::bad_alloc();
    if (flag < 0)
      throw std::runtime_error(std::string("ReverseIda: ") + function + " returned " +
                               std::to_string(flag));
  }

  void set_linear_solver() {
    const auto n = static_cast<sunindextype>(equations_.y.size());
    if (equations_.linear == Linear::own) {
      matrix_.reset(made(SUNMatNewEmpty(context_.get())));
      matrix_->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
      matrix_->ops->zero = [](SUNMatrix) { return 0; };
      matrix_->ops->destroy = SUNMatFreeEmpty;
      solver_.reset(made(SUNLinSolNewEmpty(context_.get())));
      solver_->content = this;
      solver_->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
      solver_->ops->setup = [](SUNLinearSolver, SUNMatrix) { return 0; };  // done by matrix()
      solver_->ops->solve = linear_solve;
      solver_->ops->free = [](SUNLinearSolver solver) {
        solver->content = nullptr;
        SUNLinSolFreeEmpty(solver);
        return 0;
      };
    } else {
      matrix_.reset(made(SUNDenseMatrix(n, n, context_.get())));
      solver_.reset(made(SUNLinSol_Dense(y_.get(), matrix_.get(), context_.get())));
    }
    expect(IDASetLinearSolver(mem_.get(), solver_.get(), matrix_.get()), "IDASetLinearSolver");
    if (equations_.linear != Linear::differences)
      expect(IDASetJacFn(mem_.get(), matrix), "IDASetJacFn");
  }

  tp::Constraints constraints() {
    tp::Constraints rows;
    rows.count = equations_.constraints;
    rows.names = equations_.names;
    rows.value = [this](double t, tp::ConstVector y, tp::Vector g) {
      return ask(Request::constraints, t, y.data(), nullptr, nullptr, g.data(),
                 static_cast<std::size_t>(g.size()));
    };
    if (equations_.constraint_jacobian)
      rows.jacobian = tp::DenseJacobian([this](double t, tp::ConstVector y, tp::Matrix C) {
        return ask(Request::constraint_jacobian, t, y.data(), nullptr, nullptr, C.data(),
                   static_cast<std::size_t>(C.size()));
      });
    return rows;
  }

  static int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void* data) {
    auto& self = *static_cast<Implementation*>(data);
    return self.ask(Request::residual, t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), nullptr,
                    N_VGetArrayPointer(r), self.equations_.y.size());
  }

  static int matrix(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector, SUNMatrix J,
                    void* data, N_Vector, N_Vector, N_Vector) {
    auto& self = *static_cast<Implementation*>(data);
    self.asked_.cj = cj;
    const bool own = self.equations_.linear == Linear::own;
    const std::size_t n = self.equations_.y.size();
    return self.ask(own ? Request::setup : Request::jacobian, t, N_VGetArrayPointer(y),
                    N_VGetArrayPointer(yp), nullptr, own ? nullptr : SUNDenseMatrix_Data(J),
                    own ? 0 : n * n);
  }

  static int linear_solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, sunrealtype) {
    auto& self = *static_cast<Implementation*>(solver->content);
    const Question& last = self.asked_;
    return self.ask(Request::solve, last.t, last.y, nullptr, N_VGetArrayPointer(b),
                    N_VGetArrayPointer(x), self.equations_.y.size());
  }

  /// In the fiber: the caller's answer to a request. `yp` and `rhs`: null where it has none.
  int ask(Request request, double t, const double* y, const double* yp, const double* rhs,
          double* result, std::size_t size) {
    if (abandoned_) return -1;
    asked_ = {request, t, asked_.cj, y, yp, rhs, result, size};
    const double reached = t_;
    t_ = asked_.t;
    leave();
    t_ = reached;
    return abandoned_ ? -1 : asked_.answer;
  }

  void enter() { inside_ = std::move(inside_).resume(); }
  void leave() { outside_ = std::move(outside_).resume(); }

  template <class Command>
  Request start(Command command) {
    if (asked_.open())
      throw std::logic_error(std::string("ReverseIda: the request \"") + to_string(asked_.request) +
                             "\" is open: answer it by go_on() first");
    task_ = Task{std::move(command)};
    return resume();
  }

  Request resume() {
    task_.waiting = false;
    started_ = true;
    enter();
    if (!task_.waiting) return asked_.request;  // a request
    task_.command = nullptr;
    at_rest(task_.flag < 0 || task_.thrown ? Request::failed : Request::reached);
    if (task_.thrown) std::rethrow_exception(std::exchange(task_.thrown, nullptr));
    return asked_.request;
  }

  void at_rest(Request request) {
    asked_ = {request, t_, asked_.cj, N_VGetArrayPointer(y_.get()), N_VGetArrayPointer(yp_.get())};
  }

  /// The body of the fiber; nothing is thrown out of it.
  void run_commands() noexcept {
    while (!abandoned_) {
      try {
        task_.command();
      } catch (...) {
        task_.thrown = std::current_exception();
      }
      task_.waiting = true;
      if (!abandoned_) leave();
    }
  }

  void fail() {
    if (projection_) task_.message = projection_->message();
    if (!task_.message.empty()) return;
    char* const name = IDAGetReturnFlagName(task_.flag);
    task_.message = std::string("IDASolve: ") + (name != nullptr ? name : "unknown flag");
    std::free(name);
  }

  Equations equations_;
  tp::Owned<SUNContext, free_context> context_;
  tp::Owned<N_Vector, N_VDestroy> y_, yp_, id_;
  tp::Owned<SUNMatrix, SUNMatDestroy> matrix_;
  tp::Owned<SUNLinearSolver, SUNLinSolFree> solver_;
  tp::Owned<void*, free_ida> mem_;
  std::optional<tp::Projection> projection_;

  double t_ = 0.0;
  Question asked_;
  Task task_;
  bool abandoned_ = false, started_ = false;
  // IDA runs on the stack of inside_, and goes back to the caller by outside_. Once entered,
  // inside_ has to end before it is destroyed: Boost would unwind its stack by an exception, which
  // must not pass through frames of C.
  boost::context::fiber inside_, outside_;
};

ReverseIda::ReverseIda(Equations equations, const ida_projection::SundialsBuild& host) {
  ida_projection::check_running_sundials(host);
  check(equations);
  implementation_ = std::make_unique<Implementation>(std::move(equations));
}

ReverseIda::Implementation& ReverseIda::its() const {
  return tp::owned("ReverseIda", implementation_);
}
ReverseIda::~ReverseIda() = default;
ReverseIda::ReverseIda(ReverseIda&&) noexcept = default;
ReverseIda& ReverseIda::operator=(ReverseIda&&) noexcept = default;

Request ReverseIda::solve(double tout, bool one_step) { return its().solve(tout, one_step); }
Request ReverseIda::make_consistent() { return its().make_consistent(); }
Request ReverseIda::go_on(int answer) { return its().go_on(answer); }
Request ReverseIda::request() const { return its().asked_.request; }
double ReverseIda::t() const { return its().t_; }
double ReverseIda::cj() const { return its().asked_.cj; }
const double* ReverseIda::y() const { return its().asked_.y; }
const double* ReverseIda::yp() const { return its().asked_.yp; }
const double* ReverseIda::rhs() const { return its().asked_.rhs; }
double* ReverseIda::result() const { return its().asked_.result; }
std::size_t ReverseIda::result_size() const { return its().asked_.result_size; }
int ReverseIda::flag() const { return its().task_.flag; }
std::string ReverseIda::message() const { return its().task_.message; }
void* ReverseIda::ida_mem() const { return its().mem_.get(); }
const ida_projection::Projection* ReverseIda::projection() const {
  const auto& projection = its().projection_;
  return projection ? &*projection : nullptr;
}

}  // namespace tether::reverse_ida
