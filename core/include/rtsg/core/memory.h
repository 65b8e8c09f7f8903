// How much memory the process holds, and how much it may: asked by whatever reads files, before it takes more.
//
// The limit is the process's, as setrlimit's are, since memory is: two scenes in one process share it. What counts is
// the resident set, so memory of all libraries counts, and addresses that are only reserved do not. Nothing is killed:
// who asks and is refused reads no further, and says so. Threading: any thread.
#pragma once

#include <cstdint>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The resident set of the process, bytes.
std::uint64_t heldMemory();
/// Bytes. Unless set, three quarters of the machine's memory, or of what the process's control group may have.
std::uint64_t memoryLimit();
void setMemoryLimit(std::uint64_t bytes);
/// Error: with `more` bytes the process would hold more than the limit. Costs some microseconds.
Result<> mayHold(std::uint64_t more = 0);

}  // namespace rtsg
