// Tether: threads that wait for work and meet inside it. SPDX-License-Identifier: BSD-3-Clause
#include "body_passes/worker_team.hpp"

namespace tether::contact::detail {

void Barrier::wake() {
  // A sleeper has either seen the new round or waits already: it holds the lock in between.
  { const std::lock_guard<std::mutex> lock(mutex_); }
  woken_.notify_all();
}

void Barrier::sleep(int round) {
  std::unique_lock<std::mutex> lock(mutex_);
  sleepers_.fetch_add(1);
  woken_.wait(lock, [&] { return round_.load() != round; });
  sleepers_.fetch_sub(1);
}

WorkerTeam::~WorkerTeam() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    end_ = true;
  }
  wake_.notify_all();
  for (std::thread& t : threads_) t.join();
}

void WorkerTeam::start(int threads, Call call, void* work) {
  // First, since this may throw.
  while (static_cast<int>(threads_.size()) < threads - 1) {
    const int thread = static_cast<int>(threads_.size()) + 1;
    threads_.emplace_back([this, thread] { live(thread); });
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    call_ = call;
    work_ = work;
    wanted_ = threads;
    busy_ = threads - 1;
    ++run_;
  }
  wake_.notify_all();
}

void WorkerTeam::join() {
  std::unique_lock<std::mutex> lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
}

void WorkerTeam::live(int thread) {
  long seen = 0;
  for (;;) {
    Call call;
    void* work;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait(lock, [&] { return end_ || (run_ != seen && thread < wanted_); });
      if (end_) return;
      seen = run_;
      call = call_;
      work = work_;
    }
    call(work, thread);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (--busy_ == 0) done_.notify_one();
    }
  }
}

}  // namespace tether::contact::detail
