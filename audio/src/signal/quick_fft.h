// Transforms of real signals by libavutil, through its module, because the library loads some eighteen others, which
// only sound needs.
#pragma once

#include <cstddef>

struct AVTXContext;

namespace rtsg {

/// A transform of one size in one direction.
struct QuickTransform {
    AVTXContext* context = nullptr;
    void (*run)(AVTXContext* context, void* to, void* from, std::ptrdiff_t stride) = nullptr;
};

struct QuickTransforms {
    /// False where the library has none. Forward, `scale` is 1; backward the reciprocal of the size.
    bool (*make)(std::size_t size, bool isInverse, float scale, QuickTransform& created);
    void (*destroy)(QuickTransform& created);
};

// Increase it with every change of the declarations above.
#define RTSG_FFT_SYMBOL rtsg_quick_transforms_1

}  // namespace rtsg
