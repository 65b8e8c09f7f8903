// The kernels for the lanes of a packet, eight at a time, and the choice between these and those of sixteen.
#include "packet_kernels.h"

#include "mesh/lanes8.h"
#include "packet_kernels_impl.h"

namespace rtsg::trace {

const PacketKernels& packetKernels8() {
    static constexpr const PacketKernels& table = KernelsOf<simd::Lanes8>::kTable;
    return table;
}

const PacketKernels& packetKernels() {
    static const PacketKernels& chosen = packetKernels16() ? *packetKernels16() : packetKernels8();
    return chosen;
}

}  // namespace rtsg::trace
