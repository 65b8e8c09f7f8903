// The sandbox: jobs and their results, what breaks in it, and what it does not let happen.
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <stdexcept>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <rtsg/core/machine.h>
#include <rtsg/core/sandbox.h>

namespace rtsg {
namespace {

using testing::HasSubstr;

// ---- what workers do, by the head of the job
// -------------------------------------------------------------------------

pid_t ownPid = 0;
int jobs = 0;

/// 0, or the number of the error.
std::string outcome(long result) {
    return std::to_string(result < 0 ? errno : 0);
}

const std::map<std::string, std::function<std::string()>, std::less<>> kActions{
    {"pid", [] { return std::to_string(ownPid); }},
    {"count", [] { return std::to_string(jobs); }},
    {"throw", []() -> std::string { throw std::runtime_error("thrown"); }},
    {"fault",
     []() -> std::string {
         volatile int* volatile nowhere = nullptr;
         *nowhere = 1;
         return "no fault";
     }},
    {"abort", []() -> std::string { std::abort(); }},
    {"exit", []() -> std::string { ::_exit(3); }},
    {"endless",
     [] {
         volatile bool ends = false;
         while (!ends) {
         }
         return std::string("never");
     }},
    {"memory",
     [] {
         std::vector<std::string> all;
         for (;;) all.emplace_back(16 << 20, 'x');
         return std::string("never");
     }},
    {"open", [] { return outcome(::open("/etc/passwd", O_RDONLY)); }},
    {"create", [] { return outcome(::open("/tmp/rtsg_sandbox_test", O_CREAT | O_WRONLY, 0600)); }},
    {"socket", [] { return outcome(::socket(AF_INET, SOCK_STREAM, 0)); }},
    {"fork", [] { return outcome(::fork()); }},
    {"execute", [] { return outcome(::execl("/bin/true", "true", nullptr)); }},
    {"kill", [] { return outcome(::kill(::getppid(), SIGKILL)); }},
    {"limits",
     [] {
         const rlimit all{RLIM_INFINITY, RLIM_INFINITY};
         return outcome(::setrlimit(RLIMIT_AS, &all));
     }},
    {"code",
     [] {
         void* const page =
             ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
         return outcome(page == MAP_FAILED ? -1 : 0);
     }},
    {"make code",
     [] {
         void* const page = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
         return outcome(::mprotect(page, 4096, PROT_READ | PROT_EXEC));
     }},
    {"trace", [] { return outcome(::syscall(SYS_ptrace, 16, 1, 0, 0)); }},
};

void serve(SandboxJob& job) {
    ++jobs;
    const std::string head(job.head());
    if (const auto found = kActions.find(head); found != kActions.end()) return job.answer(found->second());
    if (head == "silent") return;
    if (head == "pause") {
        std::string said = "begun";
        for (int i = 0; said != "end"; ++i) {
            if (said == "fault") *static_cast<volatile int*>(nullptr) = 1;
            std::ranges::fill(job.room(said == "nothing" ? 0 : 10'000'000), static_cast<std::uint8_t>(i));
            said = job.pause(said == "ask" ? job.ask("who?") : said);
        }
        return job.answer("ended");
    }
    if (head == "ask") return job.answer(job.ask("who?") + job.ask("where?"));
    if (head == "large") return job.room(std::size_t{1} << 40), job.answer("granted");
    // The bytes back, each one more.
    const std::span<std::uint8_t> to = job.room(job.bytes().size());
    std::ranges::transform(job.bytes(), to.begin(), [](std::uint8_t byte) { return byte + 1; });
    job.answer(head);
}

constexpr SandboxTask kTask{"tests",
                            [] {
                                ownPid = ::getpid();
                                return Result<>();
                            },
                            serve};
constexpr SandboxTask kOnce{"tests", kTask.prepare, serve, true};
constexpr SandboxTask kUnprepared{"tests", []() -> Result<> { return fail("it lacks its library"); }, serve};

/// The answer, or the error's text.
std::string say(const SandboxTask& task, std::string_view head, const SandboxLimits& limits = {}) {
    const auto result = runSandboxed(task, head, {}, {}, limits);
    return result ? result->head() : result.error().text;
}

// ---- tests
// -----------------------------------------------------------------------------------------------------------

TEST(Sandbox, GivesBytesBackOfAnySize) {
    for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{4096}, std::size_t{5'000'000},
                                   std::size_t{20'000'000}, std::size_t{100}}) {
        const std::vector<std::uint8_t> bytes(size, 7);
        const auto result = runSandboxed(kTask, "bytes", bytes);
        ASSERT_TRUE(result) << size << result.error().text;
        EXPECT_EQ(result->head(), "bytes");
        std::vector<std::uint8_t> got(result->size());
        EXPECT_TRUE(result->read(got));
        EXPECT_EQ(got, std::vector<std::uint8_t>(size, 8)) << size;
    }
}

TEST(Sandbox, AnswersQuestions) {
    const auto result =
        runSandboxed(kTask, "ask", {}, [](std::string_view question) { return "[" + std::string(question) + "]"; });
    ASSERT_TRUE(result);
    EXPECT_EQ(result->head(), "[who?][where?]");
    // Nobody is there to answer, and the worker is of no more use.
    EXPECT_FALSE(runSandboxed(kTask, "ask", {}));
    EXPECT_EQ(say(kTask, "count"), "1");
}

TEST(Sandbox, AJobWaitsForWhatTheCallerSays) {
    const std::string before = say(kTask, "pid");
    auto job = runSandboxed(kTask, "pause", {});
    for (const int i : {0, 1, 2}) {
        ASSERT_TRUE(job) << job.error().text;
        EXPECT_TRUE(job->isPaused());
        std::vector<std::uint8_t> got(job->size());
        EXPECT_EQ(got.size(), i == 1 ? 0u : 10'000'000u);
        EXPECT_TRUE(job->read(got));
        EXPECT_EQ(std::ranges::count(got, i), static_cast<std::ptrdiff_t>(got.size()));
        EXPECT_NE(say(kTask, "pid"), before) << "another worker serves others meanwhile";
        job = resumeSandboxed(std::move(*job),
                              i == 0   ? "nothing"
                              : i == 1 ? "ask"
                                       : "end",
                              [](std::string_view) { return std::string("me"); });
        if (i == 1 && job) {
            EXPECT_EQ(job->head(), "me");
        }
    }
    ASSERT_TRUE(job) << job.error().text;
    EXPECT_FALSE(job->isPaused());
    EXPECT_EQ(job->head(), "ended");
    EXPECT_FALSE(resumeSandboxed(std::move(*job), "once more")) << "there is nothing to go on with";
    EXPECT_EQ(say(kTask, "pid"), before) << "it serves others again";
}

TEST(Sandbox, APausedJobEndsWithItsResultOrByAFault) {
    const std::string before = say(kTask, "pid");
    {
        const auto left = runSandboxed(kTask, "pause", {});
    }
    EXPECT_NE(say(kTask, "pid"), before);
    auto job = runSandboxed(kTask, "pause", {});
    ASSERT_TRUE(job) << job.error().text;
    const auto broken = resumeSandboxed(std::move(*job), "fault");
    ASSERT_FALSE(broken);
    EXPECT_THAT(broken.error().text, HasSubstr("breaks the library"));
    EXPECT_EQ(say(kTask, "bytes"), "bytes");
}

TEST(Sandbox, AWorkerStaysUnlessItIsForOneJob) {
    const std::string first = say(kTask, "pid");
    EXPECT_EQ(say(kTask, "pid"), first);
#if !defined(__SANITIZE_ADDRESS__)  // which looks for the limits of the stack in a file when something is thrown
    EXPECT_EQ(say(kTask, "throw"), "thrown");
    EXPECT_EQ(say(kTask, "pid"), first);
#endif
    EXPECT_EQ(say(kOnce, "count"), "1");
    EXPECT_EQ(say(kOnce, "count"), "1");
}

TEST(Sandbox, WhatBreaksIsAnErrorAndTheNextJobIsServed) {
    for (const auto& [head, why] : std::map<std::string, std::string>{{"fault", "breaks the library"},
                                                                      {"abort", "it"},
                                                                      {"exit", "it ends without a word"},
                                                                      {"silent", "it ends without a word"}}) {
        EXPECT_THAT(say(kTask, head), HasSubstr(why)) << head;
        EXPECT_EQ(say(kTask, "bytes"), "bytes");
    }
    EXPECT_EQ(say(kUnprepared, "bytes"), "it lacks its library");
    EXPECT_EQ(say(kTask, std::string(kMaxSandboxText + 1, 'x')), "it has more parts than may be asked for at once");
}

TEST(Sandbox, MemoryAndTimeEnd) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the sanitizer ends a process that asks for so much";
#endif
    EXPECT_EQ(say(kOnce, "memory", {std::uint64_t{100} << 20}), "what it holds takes more memory than may be had");
    EXPECT_EQ(say(kTask, "large"), "what it holds takes more memory than may be had");
    EXPECT_EQ(say(kOnce, "endless", {1 << 20, 1}), "it takes too long");
    EXPECT_EQ(say(kTask, "bytes"), "bytes");
}

TEST(Sandbox, AWorkerHasNoRights) {
    if (const auto started = startSandbox(); !started) GTEST_SKIP() << started.error().text;
    for (const char* head :
         {"open", "create", "socket", "fork", "execute", "kill", "limits", "code", "make code", "trace"})
        EXPECT_EQ(say(kTask, head), std::to_string(EPERM)) << head;
    EXPECT_TRUE(isSandboxed());
}

TEST(Sandbox, EachThreadHasAWorkerOfItsOwn) {
    std::vector<std::thread> threads;
    std::vector<std::string> got(8);
    for (std::string& one : got)
        threads.emplace_back([&one] {
            for (int i = 0; i < 50; ++i) one += say(kTask, i % 10 == 9 ? "exit" : "bytes") == "bytes" ? "b" : "e";
        });
    for (std::thread& one : threads) one.join();
    std::string all;
    for (int i = 0; i < 50; ++i) all += i % 10 == 9 ? "e" : "b";
    for (const std::string& one : got) EXPECT_EQ(one, all);
}

bool isGone(pid_t pid) {
    std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
    std::string number, name, state;
    return !(file >> number >> name >> state) || state == "Z" || state == "X";
}

TEST(Sandbox, AWorkerEndsWithTheProcessThatWantsIt) {
    int ends[2];
    ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        // A copy of this process: the sandbox of that one is not its own.
        static constexpr SandboxTask kOwn{"tests", kTask.prepare, serve, false};
        const auto pid = runSandboxed(kOwn, "pid", {});
        const std::string text = pid ? pid->head() : "-1";
        (void)!::write(ends[1], text.c_str(), text.size());
        ::raise(SIGKILL);
    }
    ::close(ends[1]);
    char text[32] = {};
    ASSERT_GT(::read(ends[0], text, sizeof(text) - 1), 0);
    ::close(ends[0]);
    ::waitpid(child, nullptr, 0);
    const pid_t worker = std::atoi(text);
    ASSERT_GT(worker, 0);
    for (int i = 0; i < 1000 && !isGone(worker); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_TRUE(isGone(worker));
}

}  // namespace
}  // namespace rtsg
