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
          before(size),
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

    /// What is in `waiting` is next.
    void wait() {
        keep(std::max<std::size_t>(1, waiting.size()));
        waits = true;
    }

    /// Takes the response that waits, if there is one and none is fading in.
    void takeWaiting() {
        if (fading || !waits) return;
        std::swap(next, waiting);
        // What is short is kept, to be written over.
        if (waiting.size() > kShort) waiting.clear();
        waits = false;
        if (!started) std::swap(current, next);
        fading = started;
        started = true;
        faded = 0;
    }

    static constexpr std::size_t kShort = 16;  // parts

    std::size_t block, fadeLength;
    RealFft fft;
    std::vector<float> window, time, before;
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

namespace {

/// Parts of a response, each as long as a block and as much silence behind it. `padded`: room for that.
void transform(const RealFft& fft, std::span<const float> response, std::span<float> padded,
               std::vector<RealFft::Spectrum>& parts) {
    const std::size_t block = fft.size() / 2;
    parts.resize((response.size() + block - 1) / block);
    for (std::size_t p = 0; p < parts.size(); ++p) {
        const auto part = response.subspan(p * block, std::min(block, response.size() - p * block));
        std::fill(std::copy(part.begin(), part.end(), padded.begin()), padded.end(), 0.0f);
        fft.forward(padded, parts[p]);
    }
}

}  // namespace

Convolver::Response Convolver::prepare(std::size_t blockSize, std::span<const float> response) {
    const RealFft fft(2 * std::max<std::size_t>(2, blockSize));
    Response result;
    std::vector<float> padded(fft.size());
    transform(fft, response, padded, result.parts_);
    return result;
}

void Convolver::setResponse(std::span<const float> response) {
    Impl& s = *impl_;
    transform(s.fft, response, s.time, s.waiting);
    s.wait();
}
void Convolver::setResponse(const Response& response) {
    impl_->waiting = response.parts_;
    impl_->wait();
}
void Convolver::setResponse(Response&& response) {
    impl_->waiting = std::move(response.parts_);
    impl_->wait();
}

void Convolver::restart() {
    Impl& s = *impl_;
    std::fill(s.window.begin(), s.window.end(), 0.0f);
    for (Impl::Spectrum& spectrum : s.history) std::fill(spectrum.begin(), spectrum.end(), std::complex<float>{});
    s.fading = s.waits = s.started = false;
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
        if (!s.started || s.current.empty()) return;
        const auto result = s.convolve(s.current);
        for (std::size_t i = 0; i < s.block; ++i) output[i] += result[i];
        return;
    }
    const auto old = s.convolve(s.current);
    std::copy(old.begin(), old.end(), s.before.begin());
    const auto fresh = s.convolve(s.next);
    for (std::size_t i = 0; i < s.block; ++i) {
        const float share = fadeIn(static_cast<double>(s.faded + i + 1) / static_cast<double>(s.fadeLength));
        output[i] += s.before[i] + (fresh[i] - s.before[i]) * share;
    }
    s.faded += s.block;
    if (s.faded < s.fadeLength) return;
    std::swap(s.current, s.next);
    s.fading = false;
}

}  // namespace rtsg
