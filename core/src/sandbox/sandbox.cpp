// Starts the zygote, lends workers to jobs, and talks with them.
#include <rtsg/core/sandbox.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <ctime>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/machine.h>

#include "call_filter.h"
#include "messages.h"

namespace rtsg {

namespace sandbox {

struct WorkerProcess {
    const SandboxTask* task = nullptr;
    Descriptor socket, memory;
    pid_t pid = 0, owner = 0;                // the process that it works for
    std::uint64_t size = 0;                  // of the shared memory
    std::uint64_t space = 0;                 // addresses that it had at its start
    bool hasServed = false, isLast = false;  // another has had it; it ends now
};

}  // namespace sandbox

namespace {

using sandbox::Arrival;
using sandbox::kSharedPage;
using sandbox::Packet;
using sandbox::Word;
using sandbox::WorkerProcess;
using SandboxClock = std::chrono::steady_clock;

constexpr std::uint64_t kFreeBytes = 1 << 20;   // of a result, for which no worker asks
constexpr std::uint64_t kKeptBytes = 32 << 20;  // of shared memory, for the next job: a picture of 2048 x 2048

bool sendOrder(int socket, const sandbox::Order& order, int first, int second) {
    iovec part{const_cast<sandbox::Order*>(&order), sizeof(order)};
    const int descriptors[2] = {first, second};
    alignas(cmsghdr) char space[CMSG_SPACE(sizeof(descriptors))] = {};
    msghdr message{};
    message.msg_iov = &part, message.msg_iovlen = 1;
    if (order.ends == 0) {
        message.msg_control = space, message.msg_controllen = sizeof(space);
        cmsghdr* const with = CMSG_FIRSTHDR(&message);
        with->cmsg_level = SOL_SOCKET, with->cmsg_type = SCM_RIGHTS, with->cmsg_len = CMSG_LEN(sizeof(descriptors));
        std::memcpy(CMSG_DATA(with), descriptors, sizeof(descriptors));
    }
    ssize_t sent = -1;
    do {
        sent = ::sendmsg(socket, &message, MSG_NOSIGNAL);
    } while (sent < 0 && errno == EINTR);
    return sent == static_cast<ssize_t>(sizeof(order));
}

std::string endedBy(int status) {
    if (!WIFSIGNALED(status)) return "it ends without a word";
    if (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL) return "it takes too long";
    return std::string("it breaks the library that reads it (") + ::strsignal(WTERMSIG(status)) + ")";
}

void setWait(int socket, SandboxClock::duration wait) {
    const auto micros = std::max<std::int64_t>(std::chrono::duration_cast<std::chrono::microseconds>(wait).count(), 1);
    const timeval time{micros / 1'000'000, micros % 1'000'000};
    ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof(time));
}

/// The memory that a worker may take now, beyond what it had at its start.
std::uint64_t freeSpace(const SandboxLimits& limits) {
    const std::uint64_t maximum = memoryLimit();
    return std::min(maximum - std::min(heldMemory(), maximum), limits.bytes);
}

void setMemory(const WorkerProcess& worker, const SandboxLimits& limits) {
    rlimit both{};
    if (::prlimit(worker.pid, RLIMIT_AS, nullptr, &both) != 0) return;
    both.rlim_cur = std::min<rlim_t>(worker.space + freeSpace(limits), both.rlim_max);
    ::prlimit(worker.pid, RLIMIT_AS, &both, nullptr);
}

unsigned secondsOf(const SandboxLimits& limits) {
    return limits.seconds + limits.seconds / 4;
}

/// Processor time from now on.
void setTime(const WorkerProcess& worker, const SandboxLimits& limits) {
    clockid_t clock{};
    timespec used{};
    rlimit both{};
    if (::clock_getcpuclockid(worker.pid, &clock) != 0 || ::clock_gettime(clock, &used) != 0 ||
        ::prlimit(worker.pid, RLIMIT_CPU, nullptr, &both) != 0)
        return;
    both.rlim_cur = std::min<rlim_t>(static_cast<rlim_t>(used.tv_sec) + secondsOf(limits), both.rlim_max);
    ::prlimit(worker.pid, RLIMIT_CPU, &both, nullptr);
}

}  // namespace

/// The workers that wait, and the zygote that makes others.
class SandboxPool {
  public:
    static SandboxPool& instance() {
        static SandboxPool& pool = *new SandboxPool;  // threads may still work while the process ends
        return pool;
    }

    Result<> start();
    bool isStarted() const { return isStarted_; }
    Result<SandboxResult> run(const SandboxTask& task, std::string_view head, std::span<const std::uint8_t> bytes,
                              const SandboxAnswers& answers, const SandboxLimits& limits);
    Result<SandboxResult> resume(SandboxResult paused, std::string_view said, const SandboxAnswers& answers,
                                 const SandboxLimits& limits);
    void giveBack(WorkerProcess worker);

  private:
    /// A failure, and whether the worker that had served others before is the reason.
    struct Failure {
        std::string text;
        bool isOfWorker = false;
    };
    Result<WorkerProcess> lend(const SandboxTask& task, const SandboxLimits& limits);
    Result<WorkerProcess> create(const SandboxTask& task, const SandboxLimits& limits);
    Result<> startZygote();
    /// A process that was forked has none of the sandbox; it gets one of its own.
    void leaveThatOfParent();
    Result<sandbox::OrderAnswer> order(const sandbox::Order& order, int socket, int memory);
    /// Its status.
    int end(WorkerProcess worker);
    std::expected<SandboxResult, Failure> runIn(WorkerProcess worker, std::string_view head,
                                                std::span<const std::uint8_t> bytes, const SandboxAnswers& answers,
                                                const SandboxLimits& limits);
    /// The result, or a failure that ends the worker if it is of no more use.
    std::expected<SandboxResult, Failure> finish(WorkerProcess worker, std::uint64_t begin,
                                                 const SandboxAnswers& answers, const SandboxLimits& limits);
    std::expected<SandboxResult, Failure> talk(WorkerProcess& worker, std::uint64_t begin,
                                               const SandboxAnswers& answers, const SandboxLimits& limits);

    std::mutex mutex_;
    std::atomic<bool> isStarted_ = false;
    pid_t zygote_ = 0, owner_ = 0;  // the process that started it
    Descriptor socket_;             // to the zygote
    std::vector<WorkerProcess> idle_;
};

struct SandboxResult::Loan {
    WorkerProcess worker;
};

SandboxResult::SandboxResult() = default;
SandboxResult::SandboxResult(SandboxResult&&) noexcept = default;
SandboxResult& SandboxResult::operator=(SandboxResult&&) noexcept = default;
SandboxResult::~SandboxResult() {
    if (loan_) SandboxPool::instance().giveBack(std::move(loan_->worker));
}

bool SandboxResult::read(std::span<std::uint8_t> to) const {
    std::size_t done = 0;
    while (done < std::min(to.size(), size_)) {
        const ssize_t got =
            ::pread(loan_->worker.memory.get(), to.data() + done, size_ - done, static_cast<off_t>(offset_ + done));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        done += static_cast<std::size_t>(got);
    }
    return true;
}

void SandboxPool::leaveThatOfParent() {
    if (owner_ == ::getpid()) return;
    owner_ = ::getpid();
    zygote_ = 0;
    socket_.close();
    idle_.clear();
}

Result<> SandboxPool::startZygote() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        return fail(std::string("no sockets for the sandbox: ") + std::strerror(errno));
    Descriptor here(ends[0]), there(ends[1]);
    const pid_t child = ::fork();
    if (child < 0) return fail(std::string("no process for the sandbox: ") + std::strerror(errno));
    if (child == 0) sandbox::runZygote(ends[1]);
    // One before may have ended for want of memory.
    if (zygote_ > 0) ::waitpid(zygote_, nullptr, WNOHANG);
    zygote_ = child;
    socket_ = std::move(here);
    return {};
}

Result<> SandboxPool::start() {
    const std::scoped_lock lock(mutex_);
    leaveThatOfParent();
    isStarted_ = true;
    if (socket_.get() < 0)
        if (auto started = startZygote(); !started) return started;
    if (sandbox::hasCallFilter()) return {};
    return fail("this system has no seccomp: files are decoded in a process of its own, which has this one's rights");
}

Result<sandbox::OrderAnswer> SandboxPool::order(const sandbox::Order& order, int socket, int memory) {
    const std::scoped_lock lock(mutex_);
    for (bool isSecond = false;; isSecond = true) {
        if (socket_.get() < 0)
            if (const auto started = startZygote(); !started) return std::unexpected(started.error());
        sandbox::OrderAnswer answer;
        ssize_t got = -1;
        if (sendOrder(socket_.get(), order, socket, memory)) do {
                got = ::recv(socket_.get(), &answer, sizeof(answer), 0);
            } while (got < 0 && errno == EINTR);
        if (got == static_cast<ssize_t>(sizeof(answer))) return answer;
        socket_.close();
        if (isSecond || order.ends != 0) return fail("the sandbox has ended");
    }
}

Result<WorkerProcess> SandboxPool::create(const SandboxTask& task, const SandboxLimits& limits) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
        return fail(std::string("no sockets for the sandbox: ") + std::strerror(errno));
    WorkerProcess worker;
    worker.task = &task;
    worker.owner = ::getpid();
    worker.socket = Descriptor(ends[0]);
    const Descriptor there(ends[1]);
    worker.memory = Descriptor(::memfd_create("rtsg", MFD_CLOEXEC));
    if (worker.memory.get() < 0) return fail(std::string("no memory for the sandbox: ") + std::strerror(errno));
    sandbox::Order wanted;
    wanted.task = task;
    wanted.library = sandbox::libraryOf(reinterpret_cast<const void*>(task.serve));
    wanted.bytes = freeSpace(limits), wanted.seconds = secondsOf(limits);
    const auto created = order(wanted, there.get(), worker.memory.get());
    if (!created) return std::unexpected(created.error());
    if (created->problem < 0) return fail(std::string("the sandbox began before ") + task.name + " were loaded");
    if (created->pid == 0) return fail(std::string("no process in the sandbox: ") + std::strerror(created->problem));
    worker.pid = created->pid;
    setWait(worker.socket.get(), 4 * std::chrono::seconds(limits.seconds));
    return worker;
}

Result<WorkerProcess> SandboxPool::lend(const SandboxTask& task, const SandboxLimits& limits) {
    {
        const std::scoped_lock lock(mutex_);
        leaveThatOfParent();
        // The one that waits for the shortest time, whose memory is at hand.
        const auto found =
            std::find_if(idle_.rbegin(), idle_.rend(), [&](const WorkerProcess& one) { return one.task == &task; });
        if (found != idle_.rend()) {
            WorkerProcess worker = std::move(*found);
            idle_.erase(std::next(found).base());
            return worker;
        }
    }
    auto created = create(task, limits);
    if (!created) return created;
    const auto packet = std::make_unique<Packet>();
    // Its own end of the sockets is open in the worker alone by now.
    const Arrival arrival = sandbox::receive(created->socket.get(), *packet);
    if (arrival == Arrival::packet && packet->word == Word::ready) {
        created->space = packet->number;
        return created;
    }
    std::string why = arrival == Arrival::packet ? std::string(packet->view()) : std::string();
    const int status = end(std::move(*created));
    return fail(why.empty() ? std::string("the sandbox for ") + task.name + " does not start: " + endedBy(status)
                            : why);
}

int SandboxPool::end(WorkerProcess worker) {
    if (worker.owner != ::getpid()) return 0;
    sandbox::Order wanted;
    wanted.ends = 1, wanted.pid = worker.pid;
    worker.socket.close();
    const auto ended = order(wanted, -1, -1);
    return ended ? ended->status : 0;
}

void SandboxPool::giveBack(WorkerProcess worker) {
    constexpr std::size_t kWaiting = 4;  // of a kind
    worker.hasServed = true;
    if (worker.size > kKeptBytes && ::ftruncate(worker.memory.get(), kKeptBytes) == 0) worker.size = kKeptBytes;
    if (!worker.isLast && worker.owner == ::getpid()) {
        const std::scoped_lock lock(mutex_);
        if (std::ranges::count(idle_, worker.task, &WorkerProcess::task) < static_cast<std::ptrdiff_t>(kWaiting)) {
            idle_.push_back(std::move(worker));
            return;
        }
    }
    end(std::move(worker));
}

std::expected<SandboxResult, SandboxPool::Failure> SandboxPool::talk(WorkerProcess& worker, std::uint64_t begin,
                                                                     const SandboxAnswers& answers,
                                                                     const SandboxLimits& limits) {
    const int socket = worker.socket.get();
    const auto wait = 4 * std::chrono::seconds(limits.seconds);
    const auto end = SandboxClock::now() + wait;
    const auto packet = std::make_unique_for_overwrite<Packet>();
    for (;;) {
        const Arrival arrival = sandbox::receive(socket, *packet);
        if (arrival == Arrival::late || SandboxClock::now() > end)
            return std::unexpected(Failure{"it takes too long", false});
        if (arrival == Arrival::gone) return std::unexpected(Failure{{}, true});
        worker.isLast = packet->isLast != 0;
        switch (packet->word) {
            case Word::ask:
                if (!answers || !sandbox::send(socket, Word::answer, 0, 0, answers(packet->view())))
                    return std::unexpected(Failure{{}, true});
                break;
            case Word::grow: {
                const std::uint64_t wanted = packet->size;
                const bool may = wanted >= begin && wanted - begin <= limits.bytes && wanted > worker.size &&
                                 mayHold(wanted - worker.size).has_value() &&
                                 ::ftruncate(worker.memory.get(), static_cast<off_t>(wanted)) == 0;
                if (may) worker.size = wanted;
                if (!sandbox::send(socket, Word::granted, 0, worker.size, {}))
                    return std::unexpected(Failure{{}, true});
                break;
            }
            case Word::paused:
                worker.isLast = true;  // it can do no other job
                [[fallthrough]];
            case Word::done: {
                if (packet->number != begin || packet->size > worker.size - begin)
                    return std::unexpected(Failure{"the library that reads it is broken", true});
                SandboxResult result;
                result.head_ = packet->view();
                result.offset_ = begin, result.size_ = static_cast<std::size_t>(packet->size);
                result.isPaused_ = packet->word == Word::paused;
                return result;
            }
            case Word::broken:
                return std::unexpected(Failure{std::string(packet->view()), false});
            default:
                return std::unexpected(Failure{"the library that reads it is broken", true});
        }
    }
}

std::expected<SandboxResult, SandboxPool::Failure> SandboxPool::runIn(WorkerProcess worker, std::string_view head,
                                                                      std::span<const std::uint8_t> bytes,
                                                                      const SandboxAnswers& answers,
                                                                      const SandboxLimits& limits) {
    const std::uint64_t wanted = (bytes.size() + kSharedPage - 1) / kSharedPage * kSharedPage + kFreeBytes;
    const int memory = worker.memory.get();
    if (wanted > worker.size) {
        if (::ftruncate(memory, static_cast<off_t>(wanted)) != 0)
            return std::unexpected(Failure{std::string("no memory for the sandbox: ") + std::strerror(errno), false});
        worker.size = wanted;
    }
    for (std::size_t done = 0; done < bytes.size();) {
        const ssize_t put = ::pwrite(memory, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0)
            return std::unexpected(Failure{std::string("no memory for the sandbox: ") + std::strerror(errno), false});
        done += static_cast<std::size_t>(put);
    }
    setMemory(worker, limits);
    const std::uint64_t begin = (bytes.size() + kSharedPage - 1) / kSharedPage * kSharedPage;
    const bool isReused = worker.hasServed;
    if (!sandbox::send(worker.socket.get(), Word::job, bytes.size(), worker.size, head))
        return std::unexpected(Failure{endedBy(end(std::move(worker))), isReused});
    auto result = finish(std::move(worker), begin, answers, limits);
    if (!result) result.error().isOfWorker = result.error().isOfWorker && isReused;
    return result;
}

std::expected<SandboxResult, SandboxPool::Failure> SandboxPool::finish(WorkerProcess worker, std::uint64_t begin,
                                                                       const SandboxAnswers& answers,
                                                                       const SandboxLimits& limits) {
    auto result = talk(worker, begin, answers, limits);
    if (result) {
        result->loan_ = std::make_unique<SandboxResult::Loan>(std::move(worker));
        return result;
    }
    // A job's error leaves the worker as it was; one that broke or hangs is of no more use.
    if (!result.error().isOfWorker && !result.error().text.starts_with("it takes too long")) {
        giveBack(std::move(worker));
        return result;
    }
    const int status = end(std::move(worker));
    if (result.error().text.empty()) result.error().text = endedBy(status);
    return result;
}

Result<SandboxResult> SandboxPool::resume(SandboxResult paused, std::string_view said, const SandboxAnswers& answers,
                                          const SandboxLimits& limits) {
    if (said.size() > kMaxSandboxText) return fail("it has more parts than may be asked for at once");
    if (!paused.isPaused_ || !paused.loan_ || paused.loan_->worker.owner != ::getpid())
        return fail("the sandbox has ended");
    WorkerProcess worker = std::move(paused.loan_->worker);
    paused.loan_.reset();
    setMemory(worker, limits);
    setTime(worker, limits);
    if (!sandbox::send(worker.socket.get(), Word::answer, 0, 0, said)) return fail(endedBy(end(std::move(worker))));
    auto result = finish(std::move(worker), paused.offset_, answers, limits);
    if (result) return std::move(*result);
    return fail(std::move(result.error().text));
}

Result<SandboxResult> SandboxPool::run(const SandboxTask& task, std::string_view head,
                                       std::span<const std::uint8_t> bytes, const SandboxAnswers& answers,
                                       const SandboxLimits& limits) {
    if (head.size() > kMaxSandboxText) return fail("it has more parts than may be asked for at once");
    for (bool isSecond = false;; isSecond = true) {
        auto worker = lend(task, limits);
        if (!worker) return std::unexpected(worker.error());
        auto result = runIn(std::move(*worker), head, bytes, answers, limits);
        if (result) return std::move(*result);
        // The file before may have left it broken, so the next one gets a new one.
        if (result.error().isOfWorker && !isSecond) continue;
        return fail(std::move(result.error().text));
    }
}

Result<SandboxResult> runSandboxed(const SandboxTask& task, std::string_view head, std::span<const std::uint8_t> bytes,
                                   const SandboxAnswers& answers, const SandboxLimits& limits) {
    return SandboxPool::instance().run(task, head, bytes, answers, limits);
}

Result<SandboxResult> resumeSandboxed(SandboxResult paused, std::string_view said, const SandboxAnswers& answers,
                                      const SandboxLimits& limits) {
    return SandboxPool::instance().resume(std::move(paused), said, answers, limits);
}

Result<> startSandbox() {
    return SandboxPool::instance().start();
}

bool isSandboxed() {
    return SandboxPool::instance().isStarted();
}

}  // namespace rtsg
