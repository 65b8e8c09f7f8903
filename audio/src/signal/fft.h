// RealFft: forward and inverse transforms of one even size, over kissfft; scaled so that inverse(forward(x)) == x.
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include <kissfft/kiss_fftr.h>

namespace rtsg {

class RealFft {
  public:
    using Spectrum = std::vector<std::complex<float>>;  // size / 2 + 1

    explicit RealFft(std::size_t size)
        : size_(size),
          forward_(kiss_fftr_alloc(static_cast<int>(size), 0, nullptr, nullptr)),
          inverse_(kiss_fftr_alloc(static_cast<int>(size), 1, nullptr, nullptr)) {}

    std::size_t size() const { return size_; }
    std::size_t bins() const { return size_ / 2 + 1; }

    void forward(std::span<const float> samples, Spectrum& spectrum) const {
        spectrum.resize(bins());
        kiss_fftr(forward_.get(), samples.data(), reinterpret_cast<kiss_fft_cpx*>(spectrum.data()));
    }
    void inverse(const Spectrum& spectrum, std::span<float> samples) const {
        kiss_fftri(inverse_.get(), reinterpret_cast<const kiss_fft_cpx*>(spectrum.data()), samples.data());
        const float scale = 1.0f / static_cast<float>(size_);
        for (float& sample : samples.first(size_)) sample *= scale;
    }
    /// Smallest size of at least `atLeast` that is a power of two.
    static std::size_t sizeFor(std::size_t atLeast) {
        std::size_t size = 2;
        while (size < atLeast) size *= 2;
        return size;
    }

  private:
    struct Free {
        void operator()(kiss_fftr_state* state) const { kiss_fftr_free(state); }
    };
    std::size_t size_;
    std::unique_ptr<kiss_fftr_state, Free> forward_, inverse_;
};

}  // namespace rtsg
