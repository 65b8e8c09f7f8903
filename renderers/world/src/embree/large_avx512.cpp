// The kernels of LargeTriangles, sixteen lanes at a time in AVX-512 registers.
#include "large_triangles.h"

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#include <rtsg/core/machine.h>

#include "large_kernels_impl.h"
#include "mesh/lanes16.h"

namespace rtsg::bvh {

const LargeKernels* largeKernels16() {
    static constexpr const LargeKernels& table = LargeKernelsOf<simd::Lanes16>::kTable;
    return simd::hasAvx512() ? &table : nullptr;
}

}  // namespace rtsg::bvh

#else

namespace rtsg::bvh {

const LargeKernels* largeKernels16() {
    return nullptr;
}

}  // namespace rtsg::bvh

#endif
