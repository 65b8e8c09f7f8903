// The memory that the process holds, with a limit on it that readers of files check before they take more, and the
// instruction sets that kernels may use beyond those that everything is compiled for.
//
// The limit holds for the process, as memory does: two scenes in one process share it. It counts the resident set, so
// the memory of all libraries counts, and addresses that are only reserved do not; and files in memory, such as those
// that were fetched, which no resident set has. Nothing is killed: a reader that is refused stops and reports it.
//
// Several kernels exist twice: for what the libraries are compiled for, and with AVX-512. States have the same hash
// with any of them; pictures and sound agree within rounding. The environment variable RTSG_MAX_ISA (sse2, avx2 or
// avx512) keeps the libraries, and Embree, from higher sets than it names. It is read once. Threading: any thread.
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

namespace rtsg::simd {

/// In rising order. Processors of other kinds than x86-64 have `baseline`.
enum class InstructionSet : std::uint8_t { baseline, avx2, avx512 };

/// The highest set that the processor has and RTSG_MAX_ISA allows.
InstructionSet instructionSet();

/// Whether units that are compiled for AVX-512 (F, VL, DQ, BW, CD) may run.
bool hasAvx512();

/// The name in RTSG_MAX_ISA, or "" if the variable is not set. Embree has the same names.
const char* maxInstructionSetName();

/// Whether RTSG_MAX_ISA is not set or is one of its three names. Other values limit nothing.
bool isMaxInstructionSetKnown();

}  // namespace rtsg::simd
