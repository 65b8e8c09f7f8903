// Which instruction sets of this machine's processor the kernels may use beyond those that everything is compiled for.
//
// Several kernels exist twice: for what the libraries are compiled for, and with AVX-512. States have the same hash
// with any of them; pictures and sound agree within rounding. The environment variable RTSG_MAX_ISA (sse2, avx2 or
// avx512) keeps the libraries, and Embree, from higher sets than it names. It is read once. Threading: any thread.
#pragma once

#include <cstdint>

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
