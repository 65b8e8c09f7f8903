// Runs a function in a forked process, and gets its result through a pipe.
#include "guarded_process.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <rtsg/core/memory.h>

namespace rtsg::detail {

namespace {

using Clock = std::chrono::steady_clock;

constexpr char kGood = 'g', kBad = 'b';

void limit(int what, std::uint64_t maximum) {
    rlimit both{};
    if (::getrlimit(static_cast<__rlimit_resource>(what), &both) != 0) return;
    both.rlim_cur = both.rlim_max == RLIM_INFINITY || maximum < both.rlim_max ? maximum : both.rlim_max;
    ::setrlimit(static_cast<__rlimit_resource>(what), &both);
}

/// Bytes of address space that this process has.
std::uint64_t ownSpace() {
    unsigned long pages = 0;
    if (std::FILE* file = std::fopen("/proc/self/statm", "re")) {
        if (std::fscanf(file, "%lu", &pages) != 1) pages = 0;
        std::fclose(file);
    }
    return std::uint64_t{pages} * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

void writeAll(int descriptor, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(descriptor, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return;
        bytes.remove_prefix(static_cast<std::size_t>(count));
    }
}

/// Leaves of all descriptors standard error and the one given, which gets the number that is returned.
int keepOnly(int descriptor) {
    constexpr int kKept = 3;
    if (descriptor != kKept) ::dup2(descriptor, kKept);
    ::close_range(kKept + 1, ~0U, 0);
    // Open, as libraries may write to them.
    if (const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC); nothing >= 0) {
        ::dup2(nothing, STDIN_FILENO);
        ::dup2(nothing, STDOUT_FILENO);
        ::close(nothing);
    }
    return kKept;
}

/// Runs in the copy: signals have their default effect there, and nothing of the original process is ended.
[[noreturn]] void runHere(const std::function<bool(std::string&)>& make, const GuardLimits& limits, std::uint64_t space,
                          pid_t parent, int descriptor) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(1);  // it has ended before
    descriptor = keepOnly(descriptor);
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGTERM, SIGPIPE})
        std::signal(signal, SIG_DFL);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, limits.seconds);
    limit(RLIMIT_AS, space + limits.bytes);
    std::string result;
    bool good = false;
    try {
        good = make(result);
    } catch (const std::exception& e) {
        result = e.what();
    } catch (...) {
        result = "an exception";
    }
    writeAll(descriptor, std::string_view(good ? &kGood : &kBad, 1));
    writeAll(descriptor, result);
    ::_exit(0);
}

/// Everything that comes, until the end; nothing if it is too much or takes too long.
struct Received {
    std::string bytes;
    std::string problem;
};
Received receive(int descriptor, const GuardLimits& limits) {
    Received all;
    const auto end = Clock::now() + 4 * std::chrono::seconds(limits.seconds);
    std::string block(1 << 16, '\0');
    for (;;) {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
        pollfd waited{descriptor, POLLIN, 0};
        const int ready = left > 0 ? ::poll(&waited, 1, static_cast<int>(left)) : 0;
        if (ready < 0 && errno == EINTR) continue;
        if (ready <= 0) return {{}, "it takes too long"};
        const ssize_t count = ::read(descriptor, block.data(), block.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return all;
        if (all.bytes.size() + static_cast<std::size_t>(count) > limits.bytes + 1)
            return {{}, "what it becomes has more than " + std::to_string(limits.bytes) + " bytes"};
        constexpr std::size_t kPerLook = 1 << 20;
        if (all.bytes.size() / kPerLook != (all.bytes.size() + static_cast<std::size_t>(count)) / kPerLook)
            if (const auto ok = mayHold(2 * all.bytes.size()); !ok) return {{}, ok.error().text};
        all.bytes.append(block.data(), static_cast<std::size_t>(count));
    }
}

std::string endedBy(int status) {
    if (!WIFSIGNALED(status)) return "it ends without a word";
    if (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL) return "it takes too long";
    return std::string("it breaks the library that reads it (") + ::strsignal(WTERMSIG(status)) + ")";
}

}  // namespace

Result<std::string> runGuarded(const std::function<bool(std::string& result)>& make, const GuardLimits& limits) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) return fail(std::string("no pipe: ") + std::strerror(errno));
    const std::uint64_t space = ownSpace();
    const pid_t parent = ::getpid();
    const pid_t child = ::fork();
    if (child < 0) {
        const int why = errno;
        ::close(ends[0]);
        ::close(ends[1]);
        return fail(std::string("no process: ") + std::strerror(why));
    }
    if (child == 0) {
        ::close(ends[0]);
        runHere(make, limits, space, parent, ends[1]);
    }
    ::close(ends[1]);
    Received got = receive(ends[0], limits);
    ::close(ends[0]);
    if (!got.problem.empty()) ::kill(child, SIGKILL);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (!got.problem.empty()) return fail(got.problem);
    if (!WIFEXITED(status) || got.bytes.empty()) return fail(endedBy(status));
    const bool good = got.bytes.front() == kGood;
    got.bytes.erase(0, 1);
    if (!good) return fail(std::move(got.bytes));
    return std::move(got.bytes);
}

}  // namespace rtsg::detail
