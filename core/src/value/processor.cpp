// Asks the processor which instruction sets it has, and says at start-up if it lacks those that this build needs.
#include "rtsg/core/machine.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>

#include <unistd.h>

namespace rtsg::simd {
namespace {

struct NamedSet {
    std::string_view name;
    InstructionSet set;
};
constexpr std::array<NamedSet, 3> kNamedSets{
    {{"sse2", InstructionSet::baseline}, {"avx2", InstructionSet::avx2}, {"avx512", InstructionSet::avx512}}};

InstructionSet ofProcessor() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd"))
        return InstructionSet::avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return InstructionSet::avx2;
#endif
    return InstructionSet::baseline;
}

#if defined(__x86_64__) && defined(__AVX2__)
/// Without this check an older processor would end the program at its first unknown instruction, with no word why. It
/// is compiled for any processor, and runs before constructors that are not.
__attribute__((target("arch=x86-64"), constructor(101))) void checkProcessor() {
    __builtin_cpu_init();
    const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2")
#if defined(__AVX512F__)
                     && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl")
#endif
        ;
    if (has) return;
    static constexpr char kText[] =
        "error: this build of RTSG needs a processor with AVX2 (x86-64-v3) or what else RTSG_ARCH named;"
        " with -DRTSG_ARCH= CMake builds for any\n";
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kText, sizeof kText - 1);
    ::_exit(1);
}
#endif

}  // namespace

const char* maxInstructionSetName() {
    static const char* const name = [] {
        const char* value = std::getenv("RTSG_MAX_ISA");
        return value ? value : "";
    }();
    return name;
}

InstructionSet instructionSet() {
    static const InstructionSet result = [] {
        InstructionSet maximum = ofProcessor();
        for (const NamedSet& named : kNamedSets)
            if (named.name == maxInstructionSetName() && named.set < maximum) maximum = named.set;
        return maximum;
    }();
    return result;
}

bool hasAvx512() {
    return instructionSet() == InstructionSet::avx512;
}

bool isMaxInstructionSetKnown() {
    const std::string_view name = maxInstructionSetName();
    return name.empty() || std::ranges::any_of(kNamedSets, [&](const NamedSet& named) { return named.name == name; });
}

}  // namespace rtsg::simd
