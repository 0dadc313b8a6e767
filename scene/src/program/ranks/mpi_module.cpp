// Tether: the module tether_mpi.so. SPDX-License-Identifier: BSD-3-Clause
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <tether/contact_mpi.hpp>
#include <thread>

#include "program/ranks/ranks.hpp"

namespace tether::scene {

namespace {

constexpr std::chrono::milliseconds kPollInterval(2);
constexpr std::chrono::seconds kAbortAfter(1);  // of waiting for others, after an error

class MpiRanks final : public Ranks {
 public:
  MpiRanks() : messages_(std::make_unique<contact_mpi::Messages>(MPI_COMM_WORLD)) {}
  ~MpiRanks() override {
    messages_.reset();
    MPI_Finalize();
  }
  MpiRanks(const MpiRanks&) = delete;
  MpiRanks& operator=(const MpiRanks&) = delete;

  contact::RankMessages& messages() override { return *messages_; }

  int largest(int number) override {
    int out = 0;
    MPI_Allreduce(&number, &out, 1, MPI_INT, MPI_MAX, messages_->comm());
    return out;
  }

  // On the communicator of nothing else: who has come here for an error has left others in sums.
  int finish(int status, const std::string& why) override {
    const int mine[2] = {status, why.empty() ? 0 : 1};
    std::vector<int> all(2 * static_cast<std::size_t>(messages_->size()));
    MPI_Request request;
    MPI_Iallgather(mine, 2, MPI_INT, all.data(), 2, MPI_INT, MPI_COMM_WORLD, &request);
    const auto until = std::chrono::steady_clock::now() + kAbortAfter;
    for (int here = 0; !here;) {
      MPI_Test(&request, &here, MPI_STATUS_IGNORE);
      if (here) break;
      if (!why.empty() && std::chrono::steady_clock::now() > until) {
        say(why);
        MPI_Abort(MPI_COMM_WORLD, status);
      }
      std::this_thread::sleep_for(kPollInterval);
    }
    int code = 0, speaker = -1;
    for (int r = messages_->size() - 1; r >= 0; --r) {
      const int* its = all.data() + 2 * r;
      code = std::max(code, its[0]);
      if (its[1] != 0) speaker = r;
    }
    if (speaker == messages_->rank()) say(why);
    return code;
  }

 private:
  void say(const std::string& why) const {
    if (messages_->rank() == 0)
      std::fprintf(stderr, "tether: %s\n", why.c_str());
    else
      std::fprintf(stderr, "tether: rank %d: %s\n", messages_->rank(), why.c_str());
    std::fflush(stderr);
  }

  std::unique_ptr<contact_mpi::Messages> messages_;
};

}  // namespace

}  // namespace tether::scene

extern "C" __attribute__((visibility("default"))) tether::scene::Ranks* tether_make_ranks(
    const char* version) {
  if (std::strcmp(version, TETHER_VERSION) != 0) return nullptr;
  MPI_Init(nullptr, nullptr);
  return new tether::scene::MpiRanks;
}
