// The kernels for the lanes of a packet, sixteen at a time in AVX-512 registers.
#include "packet_kernels.h"

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#include <rtsg/core/machine.h>

#include "mesh/lanes16.h"
#include "packet_kernels_impl.h"

namespace rtsg::trace {

const PacketKernels* packetKernels16() {
    static constexpr const PacketKernels& table = KernelsOf<simd::Lanes16>::kTable;
    return simd::hasAvx512() ? &table : nullptr;
}

}  // namespace rtsg::trace

#else

namespace rtsg::trace {

const PacketKernels* packetKernels16() {
    return nullptr;
}

}  // namespace rtsg::trace

#endif
