// The module librtsg_fft.so: transforms by libavutil. It does not link this project's libraries, and throws nothing.
extern "C" {
#include <libavutil/tx.h>
}

#include "signal/quick_fft.h"

namespace rtsg {
namespace {

bool make(std::size_t size, bool isInverse, float scale, QuickTransform& created) {
    return av_tx_init(&created.context, &created.run, AV_TX_FLOAT_RDFT, isInverse ? 1 : 0, static_cast<int>(size),
                      &scale, AV_TX_UNALIGNED) >= 0;
}
void destroy(QuickTransform& created) {
    av_tx_uninit(&created.context);
}

}  // namespace
}  // namespace rtsg

extern "C" [[gnu::visibility("default")]] const rtsg::QuickTransforms* RTSG_FFT_SYMBOL() {
    static constexpr rtsg::QuickTransforms transforms{rtsg::make, rtsg::destroy};
    return &transforms;
}
