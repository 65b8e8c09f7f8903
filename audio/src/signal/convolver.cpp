// Convolves block by block in the frequency domain; a new response fades in smoothly.
#include "convolver.h"
#include <algorithm>
#include <complex>
#include <memory>
#include <utility>

#include "fade.h"
#include "fft.h"

namespace rtsg {

namespace {

using Spectrum = RealFft::Spectrum;

constexpr std::size_t kLong = 16;       // blocks of a long part
constexpr std::size_t kShorts = 15;     // short parts before long ones: these are known a block before they are heard
constexpr std::size_t kKept = kShorts;  // memory of as many parts is kept, to be written over

/// The buffers of a transform, shared by all convolvers of a thread, since buffers of their own would have to come from
/// memory in every block. Their contents are good during a call only.
struct Workspace {
    explicit Workspace(std::size_t size) : fft(size), sum(fft.bins()), time(size), before(size / 2) {}
    RealFft fft;
    Spectrum sum;
    std::vector<float> time, before;
};
Workspace& workspace(std::size_t size) {
    thread_local std::vector<std::unique_ptr<Workspace>> all;
    for (const auto& one : all)
        if (one->fft.size() == size) return *one;
    return *all.emplace_back(std::make_unique<Workspace>(size));
}

/// Parts of a response, each as long as half of the transform and as much silence behind it.
void transform(std::size_t block, std::span<const float> response, std::vector<Spectrum>& parts) {
    Workspace& work = workspace(2 * block);
    parts.resize((response.size() + block - 1) / block);
    for (std::size_t p = 0; p < parts.size(); ++p) {
        const auto part = response.subspan(p * block, std::min(block, response.size() - p * block));
        std::fill(std::copy(part.begin(), part.end(), work.time.begin()), work.time.end(), 0.0f);
        work.fft.forward(work.time, parts[p]);
    }
}

/// The last spectra of an input, as a ring.
class History {
  public:
    std::size_t size() const { return spectra_.size(); }
    /// From the newest backwards.
    const Spectrum& operator[](std::size_t age) const { return spectra_[(newest_ + age) % spectra_.size()]; }
    /// Makes the oldest the newest, to be written over.
    Spectrum& next() {
        newest_ = (newest_ + spectra_.size() - 1) % spectra_.size();
        return spectra_[newest_];
    }
    /// The added spectra are silence before all else.
    void grow(std::size_t size, std::size_t bins) {
        if (size <= spectra_.size()) return;
        std::rotate(spectra_.begin(), spectra_.begin() + static_cast<std::ptrdiff_t>(newest_), spectra_.end());
        newest_ = 0;
        spectra_.resize(size, Spectrum(bins));
    }
    void silence() {
        for (Spectrum& spectrum : spectra_) std::fill(spectrum.begin(), spectrum.end(), std::complex<float>{});
    }

  private:
    std::vector<Spectrum> spectra_;
    std::size_t newest_ = 0;
};

/// The newest block of an input through the parts of a response: as long as the block, until the workspace is used
/// again.
std::span<float> convolve(Workspace& work, const History& history, const std::vector<Spectrum>& parts) {
    std::ranges::fill(work.sum, std::complex<float>{});
    const std::size_t bins = work.sum.size();
    std::complex<float>* const sum = work.sum.data();
    for (std::size_t p = 0; p < parts.size() && p < history.size(); ++p) {
        const std::complex<float>*const x = history[p].data(), *const h = parts[p].data();
        // Written out: the library's complex product looks after infinities, at five times the cost.
        for (std::size_t i = 0; i < bins; ++i) {
            const float re = x[i].real() * h[i].real() - x[i].imag() * h[i].imag();
            const float im = x[i].real() * h[i].imag() + x[i].imag() * h[i].real();
            sum[i] = {sum[i].real() + re, sum[i].imag() + im};
        }
    }
    work.fft.inverse(std::move(work.sum), work.time);
    return std::span(work.time).last(work.time.size() / 2);
}

/// The memory of an input: its spectra by blocks and, if a response has long parts, by long blocks.
struct Input {
    Input(std::size_t size, std::size_t inOrder)
        : block(size), phase(inOrder % kLong), filled(phase), window(2 * size), history() {}

    /// Something of the last two blocks is no silence.
    bool sounds() const {
        return std::ranges::any_of(window, [](float sample) { return sample != 0; });
    }
    /// From here on the earlier input counts as silence, and new input fades in over so many samples.
    void beginSoftly(std::size_t samples) {
        silence();
        risen = 0;
        rise = samples;
    }

    std::size_t longBlock() const { return kLong * block; }
    std::size_t bins() const { return block + 1; }

    /// One block more.
    void take(std::span<const float> samples) {
        std::copy(window.begin() + static_cast<std::ptrdiff_t>(block), window.end(), window.begin());
        const auto fresh = window.begin() + static_cast<std::ptrdiff_t>(block);
        std::copy_n(samples.begin(), block, fresh);
        for (std::size_t i = 0; risen < rise && i < block; ++i)
            window[block + i] *= fadeIn(static_cast<double>(risen + i + 1) / static_cast<double>(rise));
        risen += risen < rise ? block : 0;
        history.grow(1, bins());
        workspace(2 * block).fft.forward(window, history.next());
        isComplete = false;
        phase = (phase + 1) % kLong;
        if (longHistory.size() == 0) return;
        const auto middle = longWindow.begin() + static_cast<std::ptrdiff_t>(longBlock());
        std::copy_n(fresh, block, middle + static_cast<std::ptrdiff_t>(filled * block));
        if (++filled < kLong) return;
        filled = 0;
        isComplete = true;
        workspace(2 * longBlock()).fft.forward(longWindow, longHistory.next());
        std::copy(middle, longWindow.end(), longWindow.begin());
    }

    void keep(std::size_t shorts, std::size_t longs) {
        if (longs > 0) keepLong(longs);
        history.grow(std::max<std::size_t>(1, shorts), bins());
    }

    void silence() {
        std::ranges::fill(window, 0.0f);
        std::ranges::fill(longWindow, 0.0f);
        history.silence(), longHistory.silence();
        filled = phase;
        risen = rise = 0;
    }

    std::size_t block;
    std::size_t phase;        // as if long blocks had been filled from the first block on, with or without long parts
    std::size_t filled;       // blocks of the long one that is not whole yet
    bool isComplete = false;  // a long one was, with the last block
    std::size_t risen = 0, rise = 0;  // samples of what begins softly: so far, and of all
    std::vector<float> window, longWindow;
    History history, longHistory;

  private:
    /// Long blocks are kept from here on; what short parts remember goes into them.
    void keepLong(std::size_t parts) {
        const bool first = longHistory.size() == 0;
        longHistory.grow(parts, longBlock() + 1);
        if (!first) return;
        longWindow.assign(2 * longBlock(), 0);
        filled = phase;
        Workspace& work = workspace(2 * block);
        for (std::size_t age = 0; age < std::min(history.size(), kLong + filled); ++age) {
            work.fft.inverse(history[age], work.time);
            const std::size_t at = (kLong + filled - 1 - age) * block;
            std::ranges::copy(std::span(work.time).last(block), longWindow.begin() + static_cast<std::ptrdiff_t>(at));
        }
        Workspace& longer = workspace(2 * longBlock());
        const auto middle = longer.time.begin() + static_cast<std::ptrdiff_t>(longBlock());
        std::fill(longer.time.begin(), middle, 0.0f);
        std::copy_n(longWindow.begin(), longBlock(), middle);
        longer.fft.forward(longer.time, longHistory.next());
    }
};

/// A response, and what its long parts add in the blocks until the next ones are known.
struct Parts {
    std::vector<Spectrum> shorts, longs;
    std::vector<float> ahead;
    bool empty() const { return shorts.empty(); }
};

}  // namespace

struct Convolver::Impl {
    Impl(std::shared_ptr<Input> from, std::size_t fade) : input(std::move(from)), fadeLength(fade) {}

    std::size_t block() const { return input->block; }

    /// The last block of the input so far through `response`.
    std::span<const float> hear(const Parts& response) const {
        const std::span<float> heard = convolve(workspace(2 * block()), input->history, response.shorts);
        if (!response.longs.empty())
            for (std::size_t i = 0; i < block(); ++i) heard[i] += response.ahead[input->filled * block() + i];
        return heard;
    }

    /// Computes what long parts add from the last whole long block of the input.
    void hearAhead(Parts& response) const {
        if (response.longs.empty()) return;
        std::ranges::copy(convolve(workspace(2 * input->longBlock()), input->longHistory, response.longs),
                          response.ahead.begin());
    }

    /// Makes the response in `waiting` the next one.
    void wait() {
        if (!waiting.longs.empty()) waiting.ahead.resize(input->longBlock());
        input->keep(waiting.shorts.size(), waiting.longs.size());
        waits = true;
    }

    /// Takes the response that waits, if there is one and none is fading in. True if so.
    bool takeWaiting() {
        if (fading || !waits) return false;
        std::swap(next, waiting);
        waiting.longs.clear();
        if (waiting.shorts.size() > kKept) waiting.shorts.clear();
        waits = false;
        if (!started) std::swap(current, next);
        fading = started;
        started = true;
        faded = 0;
        fadeSamples = onceIn > 0 ? std::exchange(onceIn, 0) : fadeLength;
        return true;
    }

    std::shared_ptr<Input> input;
    bool follows = false;  // another one feeds the shared input
    std::size_t fadeLength, onceIn = 0;
    std::size_t fadeSamples = fadeLength;  // of the response that fades in
    Parts current, next, waiting;
    bool fading = false, waits = false, started = false, evenly = false;
    std::size_t faded = 0;  // samples
};

Convolver::Convolver(std::size_t blockSize, std::size_t fadeSamples, std::size_t phase)
    : impl_(std::make_unique<Impl>(std::make_shared<Input>(std::max<std::size_t>(2, blockSize), phase),
                                   std::max<std::size_t>(1, fadeSamples))) {}
Convolver::Convolver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Convolver::~Convolver() = default;
Convolver::Convolver(Convolver&&) noexcept = default;
Convolver& Convolver::operator=(Convolver&&) noexcept = default;

Convolver Convolver::beside() const {
    auto other = std::make_unique<Impl>(impl_->input, impl_->fadeLength);
    other->follows = true;
    return Convolver(std::move(other));
}

void Convolver::part() {
    if (!std::exchange(impl_->follows, false)) return;
    impl_->input = std::make_shared<Input>(*impl_->input);
}

std::size_t Convolver::blockSize() const {
    return impl_->block();
}

std::size_t Convolver::blocksUntilLongWork() const {
    const Input& input = *impl_->input;
    return input.longHistory.size() == 0 ? 0 : kLong - input.filled;
}

namespace {

void cut(std::size_t block, std::span<const float> response, std::vector<Spectrum>& shorts,
         std::vector<Spectrum>& longs) {
    longs.clear();
    if (response.size() <= kLong * block) return transform(block, response, shorts);
    transform(block, response.first(kShorts * block), shorts);
    transform(kLong * block, response.subspan(kShorts * block), longs);
}

}  // namespace

Convolver::Response Convolver::prepare(std::size_t blockSize, std::span<const float> response) {
    Response result;
    cut(std::max<std::size_t>(2, blockSize), response, result.shorts_, result.longs_);
    return result;
}

void Convolver::setResponse(std::span<const float> response) {
    cut(impl_->block(), response, impl_->waiting.shorts, impl_->waiting.longs);
    impl_->wait();
}
void Convolver::setResponse(const Response& response) {
    impl_->waiting.shorts = response.shorts_, impl_->waiting.longs = response.longs_;
    impl_->wait();
}
void Convolver::setResponse(Response&& response) {
    impl_->waiting.shorts = std::move(response.shorts_), impl_->waiting.longs = std::move(response.longs_);
    impl_->wait();
}

void Convolver::fadeOnceIn(std::size_t samples) {
    impl_->onceIn = samples;
}

void Convolver::restart() {
    Impl& s = *impl_;
    s.onceIn = 0;
    if (!s.follows) s.input->silence();
    s.fading = s.waits = s.started = false;
}

void Convolver::fadeEvenly() {
    impl_->evenly = true;
}

void Convolver::process(std::span<const float> input, std::span<float> output) {
    Impl& s = *impl_;
    if (!s.follows) {
        // Nothing is kept for a response that is still to come. One that comes while something sounds would be heard of
        // the last blocks alone, and of one more with each block: steps.
        if (s.waits && !s.started && s.input->sounds()) s.input->beginSoftly(s.onceIn > 0 ? s.onceIn : s.fadeLength);
        s.input->take(input);
    }
    const bool isNew = s.takeWaiting(), isComplete = s.input->isComplete;
    if (isComplete || (isNew && !s.fading)) s.hearAhead(s.current);
    if (s.fading && (isComplete || isNew)) s.hearAhead(s.next);
    if (!s.fading) {
        if (!s.started || s.current.empty()) return;
        const auto result = s.hear(s.current);
        for (std::size_t i = 0; i < s.block(); ++i) output[i] += result[i];
        return;
    }
    std::vector<float>& before = workspace(2 * s.block()).before;
    std::ranges::copy(s.hear(s.current), before.begin());
    const auto fresh = s.hear(s.next);
    for (std::size_t i = 0; i < s.block(); ++i) {
        const double part = static_cast<double>(s.faded + i + 1) / static_cast<double>(s.fadeSamples);
        const float fraction = s.evenly ? static_cast<float>(std::min(1.0, part)) : fadeIn(part);
        output[i] += before[i] + (fresh[i] - before[i]) * fraction;
    }
    s.faded += s.block();
    if (s.faded < s.fadeSamples) return;
    std::swap(s.current, s.next);
    s.fading = false;
}

}  // namespace rtsg
