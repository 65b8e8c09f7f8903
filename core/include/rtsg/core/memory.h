// The memory that the process holds, and a limit on it, which readers of files check before they take more.
//
// The limit holds for the process, as memory does: two scenes in one process share it. It counts the resident set, so
// the memory of all libraries counts, and addresses that are only reserved do not; and files in memory, such as those
// that were fetched, which no resident set has. Nothing is killed: a reader that is
// refused stops and reports it. Threading: any thread.
#pragma once

#include <cstdint>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The resident set of the process and its files in memory, in bytes.
std::uint64_t heldMemory();
/// Counts bytes of a file in memory (memfd_create) that the process holds; fewer than 0 are those that it gives back.
void countFileInMemory(std::int64_t bytes);
/// In bytes. The default is three quarters of the machine's memory, or of the limit of the process's control group.
std::uint64_t memoryLimit();
void setMemoryLimit(std::uint64_t bytes);
/// Error: with `more` bytes the process would exceed the limit. A call takes some microseconds.
Result<> mayHold(std::uint64_t more = 0);

}  // namespace rtsg
