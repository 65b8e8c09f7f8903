// A worker: it prepares, gives its rights away, and does one job after the other.
#include <cstdio>
#include <ctime>
#include <new>
#include <utility>

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include "call_filter.h"
#include "messages.h"

namespace rtsg::sandbox {

namespace {

void limit(__rlimit_resource what, std::uint64_t maximum) {
    rlimit both{};
    if (::getrlimit(what, &both) != 0) return;
    both.rlim_cur = both.rlim_max == RLIM_INFINITY || maximum < both.rlim_max ? maximum : both.rlim_max;
    ::setrlimit(what, &both);
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

/// The memory that this process shares with the one that gives it jobs, which alone decides on its size.
class SharedMemory {
  public:
    explicit SharedMemory(int descriptor) {
        void* const first = ::mmap(nullptr, kFirst, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
        if (first != MAP_FAILED) bytes_ = static_cast<std::uint8_t*>(first), mapped_ = kFirst;
        ::close(descriptor);
    }
    /// False: there is no space for so many addresses.
    bool reach(std::uint64_t size) {
        if (size <= mapped_) return true;
        if (!bytes_) return false;
        void* const moved = ::mremap(bytes_, mapped_, size, MREMAP_MAYMOVE);
        if (moved == MAP_FAILED) return false;
        bytes_ = static_cast<std::uint8_t*>(moved), mapped_ = size;
        return true;
    }
    std::uint8_t* at(std::uint64_t offset) const { return bytes_ + offset; }

  private:
    static constexpr std::size_t kFirst = 4 << 20;
    std::uint8_t* bytes_ = nullptr;
    std::uint64_t mapped_ = 0;
};

class Job final : public SandboxJob {
  public:
    Job(int socket, SharedMemory& memory, Packet& packet)
        : socket_(socket),
          memory_(memory),
          packet_(packet),
          head_(packet.view()),
          bytes_(packet.number),
          has_(packet.size),
          begin_((packet.number + kSharedPage - 1) / kSharedPage * kSharedPage) {}

    std::string_view head() const override { return head_; }
    std::span<const std::uint8_t> bytes() const override { return {memory_.at(0), bytes_}; }

    std::string ask(std::string_view question) override {
        if (!send(socket_, Word::ask, 0, 0, question)) ::_exit(0);
        wait(Word::answer);
        return std::string(packet_.view());
    }
    std::span<std::uint8_t> room(std::size_t bytes) override {
        const std::uint64_t wanted = begin_ + bytes;
        if (wanted < bytes) throw std::bad_alloc();
        if (wanted > has_) {
            if (!send(socket_, Word::grow, 0, wanted, {})) ::_exit(0);
            wait(Word::granted);
            has_ = packet_.size;
        }
        if (wanted > has_ || !memory_.reach(wanted)) throw std::bad_alloc();
        used_ = bytes;
        return {memory_.at(begin_), bytes};
    }
    void answer(std::string head) override { answer_ = std::move(head), isAnswered_ = true; }
    std::string pause(std::string head) override {
        if (!send(socket_, Word::paused, begin_, std::exchange(used_, 0), head)) ::_exit(0);
        wait(Word::answer);
        return std::string(packet_.view());
    }

    bool finish(bool isLast) const {
        if (!isAnswered_) return send(socket_, Word::broken, 0, 0, "it ends without a word", isLast);
        return send(socket_, Word::done, begin_, used_, answer_, isLast);
    }

  private:
    void wait(Word word) {
        if (receive(socket_, packet_) != Arrival::packet || packet_.word != word) ::_exit(0);
    }

    int socket_;
    SharedMemory& memory_;
    Packet& packet_;
    std::string head_, answer_;
    std::uint64_t bytes_, has_, begin_, used_ = 0;
    bool isAnswered_ = false;
};

/// Seconds of processor time that this process has used.
std::uint64_t usedSeconds() {
    timespec used{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    return static_cast<std::uint64_t>(used.tv_sec);
}

bool serve(const Order& order, int socket, SharedMemory& memory, Packet& packet) {
    std::string problem;
    const bool isReached = memory.reach(packet.size);
    Job job(socket, memory, packet);
    try {
        if (!isReached) throw std::bad_alloc();
        order.task.serve(job);
    } catch (const std::bad_alloc&) {
        problem = "what it holds takes more memory than may be had";
    } catch (const std::exception& e) {
        problem = e.what();
    } catch (...) {
        problem = "an exception";
    }
    // The next job shall have most of the time that a job may take.
    const bool isLast = order.task.isOnce || usedSeconds() > order.seconds / 4;
    return (problem.empty() ? job.finish(isLast) : send(socket, Word::broken, 0, 0, problem, isLast)) && !isLast;
}

}  // namespace

void runWorker(int socket, int descriptor, const Order& order) {
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, order.seconds);
    // Memory that was given back stays for the next job: taking pages costs more than filling them.
    constexpr int kKeptBytes = 32 << 20;
    ::mallopt(M_MMAP_THRESHOLD, kKeptBytes);
    ::mallopt(M_TRIM_THRESHOLD, kKeptBytes);
    SharedMemory memory(descriptor);
    std::string problem;
    try {
        if (const auto prepared = order.task.prepare(); !prepared) problem = prepared.error().text;
    } catch (const std::exception& e) {
        problem = e.what();
    }
    const auto packet = std::make_unique<Packet>();
    const std::uint64_t space = ownSpace();
    limit(RLIMIT_AS, space + order.bytes);
    if (problem.empty() && hasCallFilter() && !keepFewCalls()) problem = "the kernel does not let seccomp be used";
    if (!problem.empty()) {
        send(socket, Word::broken, 0, 0, problem);
        ::_exit(0);
    }
    bool goesOn = send(socket, Word::ready, space, 0, {});
    while (goesOn && receive(socket, *packet) == Arrival::packet && packet->word == Word::job)
        goesOn = serve(order, socket, memory, *packet);
    ::_exit(0);
}

}  // namespace rtsg::sandbox
