// Tether: runs a fuzz target without libFuzzer, on inputs that are the same every time.
// SPDX-License-Identifier: BSD-3-Clause
//
//   fuzz_dat [--runs N | --seconds S] [--seed K] [--binary] [--only FILE] CORPUS ...
//
// Seconds are of the processor, so that a machine with other work fuzzes as much.
// CORPUS: files and folders of files. An input that ends the program is left in <program>.crash;
// --only runs it again.
#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "driver.hpp"

namespace fs = std::filesystem;

namespace {

std::string input;  // the present one, for the handler
char crash_file[4096];

extern "C" void leave_input(int signal) {
  const int file = open(crash_file, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file >= 0 && write(file, input.data(), input.size()) >= 0) close(file);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void execute() {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
}

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    std::fprintf(stderr, "no file %s\n", file.c_str());
    std::exit(2);
  }
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void read_corpus(const fs::path& path, std::vector<std::string>& out) {
  if (!fs::is_directory(path)) {
    out.push_back(content(path));
    return;
  }
  std::set<fs::path> files;  // in one order everywhere
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.is_regular_file()) files.insert(entry.path());
  for (const fs::path& file : files) out.push_back(content(file));
}

}  // namespace

int main(int argc, char** argv) {
  long runs = 1000;
  double seconds = 0;
  std::uint32_t seed = 1;
  bool text = true;
  std::vector<std::string> corpus = own_corpus();
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    const char* const value = k + 1 < argc ? argv[k + 1] : "";
    if (word == "--binary") {
      text = false;
      continue;
    }
    if (word == "--only") {
      input = content(value);
      execute();
      return 0;
    }
    if (word.rfind("--", 0) != 0) {
      read_corpus(word, corpus);
      continue;
    }
    if (word == "--runs") runs = std::atol(value);
    if (word == "--seconds") seconds = std::atof(value);
    if (word == "--seed") seed = static_cast<std::uint32_t>(std::atol(value));
    ++k;
  }
  if (corpus.empty()) {
    std::fprintf(stderr, "%s: no corpus\n", argv[0]);
    return 2;
  }
  std::snprintf(crash_file, sizeof crash_file, "%s.crash", argv[0]);
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGPROF})
    std::signal(signal, leave_input);

  tether::fuzz::Random random(seed);
  const auto spent = [] {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  };
  itimerval a_minute{};
  a_minute.it_value.tv_sec = 60;
  long run = 0;
  for (const std::string& each : corpus) {
    input = each;
    execute();
  }
  // Inputs that did not end anything are mutated further, now and then.
  std::vector<std::string> children;
  for (; seconds > 0 ? spent() < seconds : run < runs; ++run) {
    const bool from_child = !children.empty() && random.below(4) == 0;
    const std::string& parent =
        from_child ? children[random.below(children.size())] : corpus[random.below(corpus.size())];
    const std::string other = corpus[random.below(corpus.size())];
    input = tether::fuzz::mutated(parent, other, text, random);
    setitimer(ITIMER_PROF, &a_minute, nullptr);  // none may take more
    execute();
    if (random.below(20) == 0 && input.size() < (std::size_t{1} << 16)) {
      if (children.size() < 500)
        children.push_back(input);
      else
        children[random.below(children.size())] = input;
    }
  }
  std::printf("%ld inputs from %zu files in %.1f s, seed %u: no finding\n", run, corpus.size(),
              spent(), seed);
}
