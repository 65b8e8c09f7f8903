// Convolves block by block in the frequency domain; a new response fades in smoothly.
#include <rtsg/audio/convolver.h>
#include <algorithm>
#include <cmath>

#include "fade.h"
#include "fft.h"

namespace rtsg {
struct Convolver::Impl {
    using Spectrum = RealFft::Spectrum;

    Impl(std::size_t size, std::size_t fadeSamples)
        : block(size),
          fadeLength(std::max<std::size_t>(1, fadeSamples)),
          fft(2 * size),
          window(2 * size),
          time(2 * size),
          sum(fft.bins()) {}

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

    /// Takes the response that waits, if there is one and none is fading in.
    void takeWaiting() {
        if (fading || !waits) return;
        next = std::move(waiting);
        waits = false;
        if (!started) current = std::move(next);
        fading = started;
        started = true;
        faded = 0;
    }

    std::size_t block, fadeLength;
    RealFft fft;
    std::vector<float> window, time;
    Spectrum sum;
    std::vector<Spectrum> history;  // of the input, ring with the newest at `newest`
    std::size_t newest = 0;
    std::vector<Spectrum> current, next, waiting;
    bool fading = false, waits = false, started = false;
    std::size_t faded = 0;  // samples
};

Convolver::Convolver(std::size_t blockSize, std::size_t fadeSamples)
    : impl_(std::make_unique<Impl>(std::max<std::size_t>(2, blockSize), fadeSamples)) {}
Convolver::~Convolver() = default;
Convolver::Convolver(Convolver&&) noexcept = default;
Convolver& Convolver::operator=(Convolver&&) noexcept = default;

std::size_t Convolver::blockSize() const {
    return impl_->block;
}

Convolver::Response Convolver::prepare(std::size_t blockSize, std::span<const float> response) {
    const std::size_t block = std::max<std::size_t>(2, blockSize);
    RealFft fft(2 * block);
    Response result;
    result.parts_.resize((response.size() + block - 1) / block);
    std::vector<float> padded(2 * block);
    for (std::size_t p = 0; p < result.parts_.size(); ++p) {
        const auto part = response.subspan(p * block, std::min(block, response.size() - p * block));
        std::fill(padded.begin(), padded.end(), 0.0f);
        std::copy(part.begin(), part.end(), padded.begin());
        fft.forward(padded, result.parts_[p]);
    }
    return result;
}

void Convolver::setResponse(Response response) {
    Impl& s = *impl_;
    s.waiting = std::move(response.parts_);
    s.keep(std::max<std::size_t>(1, s.waiting.size()));
    s.waits = true;
}

void Convolver::process(std::span<const float> input, std::span<float> output) {
    Impl& s = *impl_;
    std::copy(s.window.begin() + static_cast<std::ptrdiff_t>(s.block), s.window.end(), s.window.begin());
    std::copy_n(input.begin(), s.block, s.window.begin() + static_cast<std::ptrdiff_t>(s.block));
    s.keep(1);
    s.newest = (s.newest + s.history.size() - 1) % s.history.size();
    s.fft.forward(s.window, s.history[s.newest]);
    s.takeWaiting();
    if (!s.fading) {
        if (s.current.empty()) return;
        const auto result = s.convolve(s.current);
        for (std::size_t i = 0; i < s.block; ++i) output[i] += result[i];
        return;
    }
    const auto old = s.convolve(s.current);
    const std::vector<float> before(old.begin(), old.end());
    const auto fresh = s.convolve(s.next);
    for (std::size_t i = 0; i < s.block; ++i) {
        const float share = fadeIn(static_cast<double>(s.faded + i + 1) / static_cast<double>(s.fadeLength));
        output[i] += before[i] + (fresh[i] - before[i]) * share;
    }
    s.faded += s.block;
    if (s.faded < s.fadeLength) return;
    std::swap(s.current, s.next);
    s.fading = false;
}

}  // namespace rtsg
