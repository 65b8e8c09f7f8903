// Whether this machine's processor supports units compiled for x86-64-v4.
#pragma once

namespace rtsg::simd {

/// Inlined by force, so that the linker takes no code of such a unit for others'. Threading: any thread.
__attribute__((always_inline)) static inline bool hasAvx512() {
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512cd");
#else
    return false;
#endif
}

}  // namespace rtsg::simd
