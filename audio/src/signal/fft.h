// RealFft: forward and inverse transforms of one even size; scaled so that inverse(forward(x)) == x.
//
// Sizes that are powers of two use FFmpeg's libavutil through a module, if it is installed, which uses vector
// instructions; other sizes, and builds without the module, use kissfft. So the last bits depend on machine and build.
// Threading: one thread per object.
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace rtsg {

class RealFft {
  public:
    using Spectrum = std::vector<std::complex<float>>;  // size / 2 + 1

    explicit RealFft(std::size_t size);
    /// One of this size that the calling thread keeps: to make one takes longer than to use it a few times. The thread
    /// keeps the last few sizes.
    static std::shared_ptr<const RealFft> kept(std::size_t size);
    ~RealFft();
    RealFft(RealFft&&) noexcept;
    RealFft& operator=(RealFft&&) noexcept;

    std::size_t size() const { return size_; }
    std::size_t bins() const { return size_ / 2 + 1; }

    void forward(std::span<const float> samples, Spectrum& spectrum) const;
    void inverse(const Spectrum& spectrum, std::span<float> samples) const;
    /// The same, quicker: what becomes of the spectrum is not told.
    void inverse(Spectrum&& spectrum, std::span<float> samples) const;
    /// Smallest size of at least `atLeast` that is a power of two.
    static std::size_t sizeFor(std::size_t atLeast) {
        std::size_t size = 2;
        while (size < atLeast) size *= 2;
        return size;
    }

  private:
    struct Plans;
    std::size_t size_;
    std::unique_ptr<Plans> plans_;
};

}  // namespace rtsg
