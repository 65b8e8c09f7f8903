// Transforms of real signals, by the module of libavutil or by kissfft.
#include "fft.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <stdexcept>
#include <utility>

#include <kissfft/kiss_fftr.h>

#include "sound_libraries.h"

#if defined(RTSG_AVUTIL)
#include <rtsg/core/module.h>

#include "quick_fft.h"
#endif

namespace rtsg {

namespace {

struct FreeKiss {
    void operator()(kiss_fftr_state* state) const { kiss_fftr_free(state); }
};
using Kiss = std::unique_ptr<kiss_fftr_state, FreeKiss>;

#if defined(RTSG_AVUTIL)
#define RTSG_FFT_TEXT_OF(name) #name
#define RTSG_FFT_TEXT(name) RTSG_FFT_TEXT_OF(name)

/// Null without the module: then kissfft does all, for four times the time.
const QuickTransforms* quickTransforms() {
    static const QuickTransforms* const loaded = []() -> const QuickTransforms* {
        const auto symbol = loadModule("rtsg_fft", RTSG_FFT_TEXT(RTSG_FFT_SYMBOL), "quick transforms need");
        return symbol ? reinterpret_cast<const QuickTransforms* (*)()>(*symbol)() : nullptr;
    }();
    return loaded;
}

/// A transform of libavutil, if it has one.
class Vectorised {
  public:
    Vectorised(std::size_t size, bool isInverse) {
        // Other sizes, and larger ones, it may take by the sum that defines them; those with an odd half are wrong.
        if (size < kMin || size > kMax || !std::has_single_bit(size) || !quickTransforms()) return;
        const float scale = isInverse ? 1.0f / static_cast<float>(size) : 1.0f;
        if (!quickTransforms()->make(size, isInverse, scale, created_)) created_.context = nullptr;
    }
    ~Vectorised() {
        if (created_.context) quickTransforms()->destroy(created_);
    }
    Vectorised(const Vectorised&) = delete;
    Vectorised& operator=(const Vectorised&) = delete;

    explicit operator bool() const { return created_.context != nullptr; }
    /// An inverse one writes over its input.
    template <class To, class From>
    void operator()(To* to, From* from) const {
        created_.run(created_.context, to, from, sizeof(From));
    }

  private:
    static constexpr std::size_t kMin = 16, kMax = std::size_t{1} << 17;
    QuickTransform created_;
};
#endif

}  // namespace

struct RealFft::Plans {
#if defined(RTSG_AVUTIL)
    explicit Plans(std::size_t size) : quickForward(size, false), quickInverse(size, true) {
        if (!quickForward || !quickInverse) plan(size);
    }
    Vectorised quickForward, quickInverse;
    Spectrum copy;
#else
    explicit Plans(std::size_t size) { plan(size); }
#endif
    void plan(std::size_t size) {
        if (const auto loaded = delayed::sound.load(); !loaded) throw std::runtime_error(loaded.error().text);
        forward.reset(kiss_fftr_alloc(static_cast<int>(size), 0, nullptr, nullptr));
        inverse.reset(kiss_fftr_alloc(static_cast<int>(size), 1, nullptr, nullptr));
    }
    Kiss forward, inverse;  // null: not needed
};

RealFft::RealFft(std::size_t size) : size_(size), plans_(std::make_unique<Plans>(size)) {}
std::shared_ptr<const RealFft> RealFft::kept(std::size_t size) {
    constexpr std::size_t kMax = 8;
    thread_local std::vector<std::shared_ptr<const RealFft>> all;
    auto found = std::ranges::find_if(all, [size](const auto& fft) { return fft->size() == size; });
    if (found == all.end()) {
        if (all.size() == kMax) all.erase(all.begin());
        all.push_back(std::make_shared<RealFft>(size));
        found = std::prev(all.end());
    }
    std::rotate(found, std::next(found), all.end());  // the last one used is the last to go
    return all.back();
}
RealFft::~RealFft() = default;
RealFft::RealFft(RealFft&&) noexcept = default;
RealFft& RealFft::operator=(RealFft&&) noexcept = default;

void RealFft::forward(std::span<const float> samples, Spectrum& spectrum) const {
    spectrum.resize(bins());
#if defined(RTSG_AVUTIL)
    // It reads only, though its type does not say so.
    if (!plans_->forward) return plans_->quickForward(spectrum.data(), const_cast<float*>(samples.data()));
#endif
    kiss_fftr(plans_->forward.get(), samples.data(), reinterpret_cast<kiss_fft_cpx*>(spectrum.data()));
}

void RealFft::inverse(const Spectrum& spectrum, std::span<float> samples) const {
#if defined(RTSG_AVUTIL)
    if (!plans_->inverse) {
        plans_->copy = spectrum;
        return plans_->quickInverse(samples.data(), plans_->copy.data());
    }
#endif
    kiss_fftri(plans_->inverse.get(), reinterpret_cast<const kiss_fft_cpx*>(spectrum.data()), samples.data());
    const float scale = 1.0f / static_cast<float>(size_);
    for (float& sample : samples.first(size_)) sample *= scale;
}

void RealFft::inverse(Spectrum&& spectrum, std::span<float> samples) const {
#if defined(RTSG_AVUTIL)
    if (!plans_->inverse) return plans_->quickInverse(samples.data(), spectrum.data());
#endif
    inverse(std::as_const(spectrum), samples);
}

}  // namespace rtsg
