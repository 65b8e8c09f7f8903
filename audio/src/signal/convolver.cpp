// Convolves block by block in the frequency domain; a new response fades in over one block.
#include <rtsg/audio/convolver.h>
#include <algorithm>

#include "fft.h"

namespace rtsg {

struct Convolver::Impl {
    using Spectrum = RealFft::Spectrum;

    explicit Impl(std::size_t size) : block(size), fft(2 * size), window(2 * size), time(2 * size), sum(fft.bins()) {}

    /// The last block of the input so far through `response`, into `time`'s second half.
    std::span<const float> convolve(const std::vector<Spectrum>& response) {
        std::fill(sum.begin(), sum.end(), std::complex<float>{});
        for (std::size_t p = 0; p < response.size() && p < history.size(); ++p) {
            const Spectrum& x = history[(newest + p) % history.size()];
            const Spectrum& h = response[p];
            // Written out: the library's complex product looks after infinities, at five times the cost.
            for (std::size_t i = 0; i < sum.size(); ++i) {
                const float re = x[i].real() * h[i].real() - x[i].imag() * h[i].imag();
                const float im = x[i].real() * h[i].imag() + x[i].imag() * h[i].real();
                sum[i] = {sum[i].real() + re, sum[i].imag() + im};
            }
        }
        fft.inverse(sum, time);
        return std::span<const float>(time).last(block);
    }

    void keep(std::size_t partitions) {
        if (partitions <= history.size()) return;
        // Oldest last: rotate so that new, silent places come after it.
        std::rotate(history.begin(), history.begin() + static_cast<std::ptrdiff_t>(newest), history.end());
        newest = 0;
        history.resize(partitions, Spectrum(fft.bins()));
    }

    std::size_t block;
    RealFft fft;
    std::vector<float> window, time;
    Spectrum sum;
    std::vector<Spectrum> history;  // of the input, ring with the newest at `newest`
    std::size_t newest = 0;
    std::vector<Spectrum> current, next;
    bool changing = false, started = false;
};

Convolver::Convolver(std::size_t blockSize) : impl_(std::make_unique<Impl>(std::max<std::size_t>(2, blockSize))) {}
Convolver::~Convolver() = default;
Convolver::Convolver(Convolver&&) noexcept = default;
Convolver& Convolver::operator=(Convolver&&) noexcept = default;

std::size_t Convolver::blockSize() const {
    return impl_->block;
}

void Convolver::setResponse(std::span<const float> response) {
    Impl& s = *impl_;
    const std::size_t partitions = (response.size() + s.block - 1) / s.block;
    s.next.resize(partitions);
    std::vector<float> padded(2 * s.block);
    for (std::size_t p = 0; p < partitions; ++p) {
        const auto part = response.subspan(p * s.block, std::min(s.block, response.size() - p * s.block));
        std::fill(padded.begin(), padded.end(), 0.0f);
        std::copy(part.begin(), part.end(), padded.begin());
        s.fft.forward(padded, s.next[p]);
    }
    s.keep(std::max<std::size_t>(1, partitions));
    s.changing = true;
}

void Convolver::process(std::span<const float> input, std::span<float> output) {
    Impl& s = *impl_;
    std::copy(s.window.begin() + static_cast<std::ptrdiff_t>(s.block), s.window.end(), s.window.begin());
    std::copy_n(input.begin(), s.block, s.window.begin() + static_cast<std::ptrdiff_t>(s.block));
    s.keep(1);
    s.newest = (s.newest + s.history.size() - 1) % s.history.size();
    s.fft.forward(s.window, s.history[s.newest]);
    if (s.changing) {
        std::vector<float> before(s.block);
        if (!s.current.empty()) {
            const auto old = s.convolve(s.current);
            std::copy(old.begin(), old.end(), before.begin());
        }
        const auto fresh = s.convolve(s.next);
        for (std::size_t i = 0; i < s.block; ++i) {
            const float fade = !s.started ? 1.0f : static_cast<float>(i + 1) / static_cast<float>(s.block);
            output[i] += before[i] + (fresh[i] - before[i]) * fade;
        }
        std::swap(s.current, s.next);
        s.changing = false;
        s.started = true;
    } else if (!s.current.empty()) {
        const auto result = s.convolve(s.current);
        for (std::size_t i = 0; i < s.block; ++i) output[i] += result[i];
    }
}

}  // namespace rtsg
