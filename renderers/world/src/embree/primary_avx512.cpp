// The kernels of PrimaryHits, sixteen lanes at a time in AVX-512 registers.
#include "primary_hits.h"

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#include <rtsg/core/machine.h>

#include "mesh/lanes16.h"
#include "primary_kernels_impl.h"

namespace rtsg::bvh {

const PrimaryKernels* primaryKernels16() {
    static constexpr const PrimaryKernels& table = PrimaryKernelsOf<simd::Lanes16>::kTable;
    return simd::hasAvx512() ? &table : nullptr;
}

}  // namespace rtsg::bvh

#else

namespace rtsg::bvh {

const PrimaryKernels* primaryKernels16() {
    return nullptr;
}

}  // namespace rtsg::bvh

#endif
