// The sandbox: bytes of strangers go through libraries that are not ours in processes that can do nothing else.
//
// startSandbox() forks a small process, the zygote, which forks a worker for each kind of task when one is asked for.
// A worker loads what its task needs; from then on it has no files, no sockets and no other processes (seccomp), limits
// of memory and time, and ends with this process. It stays for the next job. A job that breaks it is an error of that
// job. What a worker says is not trusted: callers check what comes out. A kernel without seccomp leaves a process of
// its own, and startSandbox() says so. Threading: startSandbox() once, before other threads if possible; runSandboxed()
// on any threads, each of which gets a worker of its own.
#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// What a job is for the function that does it, in the worker.
class SandboxJob {
  public:
    virtual ~SandboxJob() = default;
    /// What the caller gave.
    virtual std::string_view head() const = 0;
    virtual std::span<const std::uint8_t> bytes() const = 0;
    /// Asks the caller, and waits for its answer.
    virtual std::string ask(std::string_view question) = 0;
    /// Where bytes of the result go; a second call gives another space with nothing in it. Throws std::bad_alloc if the
    /// caller does not grant it.
    virtual std::span<std::uint8_t> room(std::size_t bytes) = 0;
    /// The result: this, and all that room() gave.
    virtual void answer(std::string head) = 0;
    /// A result on the way, after which the job goes on when the caller says so, with what it then says. Takes back
    /// what room() gave.
    virtual std::string pause(std::string head) = 0;
};

/// One kind of job: functions of the program, or of libraries that were loaded before startSandbox(). One object for
/// the time of the program.
struct SandboxTask {
    const char* name;
    /// Loads what serve() needs, before the rights go. An error is that of each job.
    Result<> (*prepare)();
    /// What it throws is the job's error.
    void (*serve)(SandboxJob& job);
    bool isOnce = false;  // each job has a worker of its own
};

struct SandboxLimits {
    std::uint64_t bytes = std::uint64_t{4} << 30;  // of the result, and of the worker's memory
    unsigned seconds = 60;                         // of processor time, within some; four times that by the clock
};

/// The result of a job, or of its part until pause(). Its worker serves nobody else as long as it exists, and ends if
/// the job is paused by then.
class SandboxResult {
  public:
    SandboxResult();
    SandboxResult(SandboxResult&&) noexcept;
    SandboxResult& operator=(SandboxResult&&) noexcept;
    ~SandboxResult();

    const std::string& head() const { return head_; }
    std::size_t size() const { return size_; }
    bool isPaused() const { return isPaused_; }
    /// Copies all bytes; `to` has size() of them. False: the system does not give them.
    bool read(std::span<std::uint8_t> to) const;

  private:
    friend class SandboxPool;
    struct Loan;
    std::unique_ptr<Loan> loan_;
    std::string head_;
    std::uint64_t offset_ = 0;
    std::size_t size_ = 0;
    bool isPaused_ = false;
};

using SandboxAnswers = std::function<std::string(std::string_view question)>;

/// Heads, questions and answers have at most this many bytes.
constexpr std::size_t kMaxSandboxText = 32 << 10;

/// Numbers at the beginning of a head, a question or an answer, and taken from there again; these may be anything.
template <class Numbers>
std::string sandboxText(const Numbers& numbers, std::string_view rest = {}) {
    static_assert(std::is_trivially_copyable_v<Numbers>);
    std::string text(sizeof(numbers), '\0');
    std::memcpy(text.data(), &numbers, sizeof(numbers));
    return text.append(rest);
}
template <class Numbers>
bool takeSandboxNumbers(std::string_view& text, Numbers& numbers) {
    static_assert(std::is_trivially_copyable_v<Numbers>);
    if (text.size() < sizeof(numbers)) return false;
    std::memcpy(&numbers, text.data(), sizeof(numbers));
    text.remove_prefix(sizeof(numbers));
    return true;
}

/// Does a job in a worker; starts the zygote if startSandbox() was not called. Errors: what serve() threw; the worker
/// broke, or took too long; there are no workers.
Result<SandboxResult> runSandboxed(const SandboxTask& task, std::string_view head, std::span<const std::uint8_t> bytes,
                                   const SandboxAnswers& answers = {}, const SandboxLimits& limits = {});

/// Goes on with a paused job, until its end or the next pause. The limits are those of this part. Errors as above.
Result<SandboxResult> resumeSandboxed(SandboxResult paused, std::string_view said, const SandboxAnswers& answers = {},
                                      const SandboxLimits& limits = {});

/// Starts the zygote; later calls do nothing and return what the first one did. Error: workers will have all rights
/// that this process has, because the kernel has no seccomp, or there are no workers and each job is that error.
Result<> startSandbox();
/// Whether startSandbox() was called: then readers of strangers' files give them to runSandboxed().
bool isSandboxed();

}  // namespace rtsg
