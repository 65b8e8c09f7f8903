// What a process and its workers say to each other: packets over a pair of sockets.
//
// Threading: one thread for each end.
#pragma once

#include <cstdint>
#include <string_view>

#include <sys/types.h>

#include <rtsg/core/sandbox.h>

namespace rtsg::sandbox {

/// Results begin at a multiple of this, behind the job's bytes.
constexpr std::uint64_t kSharedPage = 4096;

enum class Word : std::uint32_t {
    ready,    // of a worker: it is confined; number: its address space
    broken,   // of a worker: text says why the job, or its start, did not work
    job,      // to a worker: number: bytes in shared memory; size: that memory's bytes
    ask,      // of a worker: text
    answer,   // to a worker: text
    grow,     // of a worker: size: bytes that shared memory is to have
    granted,  // to a worker: size: bytes that it has
    done,     // of a worker: text, number: where the result begins; size: its bytes
    paused    // of a worker: the same, and it waits for an answer
};

struct Packet {
    Word word = Word::broken;
    std::uint32_t isLast = 0;  // the worker ends, as it has used much time
    std::uint64_t number = 0, size = 0;
    char text[kMaxSandboxText];
    std::size_t textSize = 0;  // not sent

    std::string_view view() const { return {text, textSize}; }
};

/// The packet without `text` is its head. False: the other end is gone.
bool send(int socket, Word word, std::uint64_t number, std::uint64_t size, std::string_view text, bool isLast = false);
enum class Arrival : std::uint8_t { packet, late, gone };
Arrival receive(int socket, Packet& packet);

/// To the zygote, with the worker's end of its socket and its shared memory.
struct Order {
    std::uint32_t ends = 0;  // not 0: the worker `pid` is to end, and its status is the answer
    pid_t pid = 0;
    SandboxTask task{};
    const void* library = nullptr;  // where the functions' library begins
    std::uint64_t bytes = 0;        // of memory beyond what the worker has at its start
    std::uint32_t seconds = 0;
};
struct OrderAnswer {
    pid_t pid = 0;  // 0: `problem` is the error's number, or negative: there is no such function there
    int problem = 0, status = 0;
};

/// Where the library of a function begins; null: nowhere.
const void* libraryOf(const void* function);

/// The zygote, until the other end of its socket is gone.
[[noreturn]] void runZygote(int socket);
/// The worker, likewise.
[[noreturn]] void runWorker(int socket, int memory, const Order& order);

}  // namespace rtsg::sandbox
