// Reads what a source played at the delays of its images.
#include "engine/image_player.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "signal/fade.h"

namespace rtsg {
namespace {

/// What is kept of what was played, for images that come later; seconds of delay.
constexpr double kKept = 0.15;

}  // namespace

void ImagePlayer::render(const Block& block) {
    double longest = kKept * block.response.sampleRate;
    for (const Set* set : {&current_, &next_})
        for (const Voice& voice : set->voices)
            longest = std::max(longest, voice.delay + 2 * static_cast<double>(block_));
    for (std::size_t k = 0; k < block.late.size(); ++k)
        lines_[k].write(block.late[k], static_cast<std::size_t>(longest) + 64);
    // As Convolver::process() has it.
    if (!fading_ && waits_) {
        next_ = {std::exchange(waiting_, nullptr), {}};
        if (next_.images) next_.voices.resize(next_.images->size());
        waits_ = false;
        if (!started_) current_ = std::exchange(next_, {});
        fading_ = started_;
        started_ = true;
        faded_ = 0;
    }
    render(current_, block, false);
    if (!fading_) return;
    render(next_, block, true);
    faded_ += block_;
    if (faded_ < fade_) return;
    current_ = std::exchange(next_, {});
    fading_ = false;
}

void ImagePlayer::render(Set& set, const Block& block, bool arrives) {
    if (set.voices.empty()) return;
    std::vector<float> weights(block_, 1.0f);
    if (fading_)
        for (std::size_t i = 0; i < block_; ++i) {
            const float share = fadeIn(static_cast<double>(faded_ + i + 1) / static_cast<double>(fade_));
            weights[i] = arrives ? share : 1 - share;
        }
    for (std::size_t k = 0; k < set.voices.size(); ++k) render((*set.images)[k], set.voices[k], block, weights);
}

/// By sample; cubic between the places that are asked for.
std::vector<double> ImagePlayer::delaysOf(const FollowedImage& image, Voice& voice, const Block& block) const {
    std::vector<double> delays(block_);
    double from = voice.delay, slope = voice.slope;
    int step = 0;
    for (std::size_t at = 0; at < block_; ++step) {
        const std::size_t next = std::min(block_, at + kStep);
        const double h = static_cast<double>(next - at);
        double delay = from + slope * h, after = 0;
        block.find(image, step, delay, after);
        const double way = delay - from, a = slope * h, b = after * h;
        for (std::size_t i = at; i < next; ++i) {
            const double u = static_cast<double>(i + 1 - at) / h;
            delays[i] = from + u * (a + u * (3 * way - 2 * a - b + u * (a + b - 2 * way)));
        }
        from = delay, slope = after;
        at = next;
    }
    voice.delay = from;
    voice.slope = slope;
    return delays;
}

void ImagePlayer::render(const FollowedImage& image, Voice& voice, const Block& block, std::span<const float> weights) {
    const std::size_t channels = block.out.size();
    const bool fresh = !std::exchange(voice.started, true);
    if (fresh) block.find(image, -1, voice.delay, voice.slope);
    const double before = voice.delay;
    const std::vector<double> delays = delaysOf(image, voice, block);
    const glm::dvec3 from = block.from(image, voice.delay);
    const double distance = glm::length(from);
    const glm::dvec3 direction = distance > 0 ? from / distance : glm::dvec3(0, 0, -1);
    const double amplitude = (image.filtered ? 1 : image.pressure) / std::max(distance, 0.01);
    std::vector<ArrivalPan> pans(channels);
    for (std::size_t c = 0; c < channels; ++c) {
        pans[c] = panOf(direction, static_cast<int>(c), block.response);
        pans[c].gain *= amplitude;
        pans[c].delay *= block.response.sampleRate;
    }
    const std::vector<ArrivalPan> last = std::exchange(voice.pans, pans);
    const std::vector<ArrivalPan>& was = fresh ? pans : last;
    // One signal for all channels, unless these hear others, or each at its time.
    const bool apart = block.late.size() > 1 || block.response.channels == ImpulseResponseOptions::Channels::binaural;
    std::vector<float> read(block_), heard(block_);
    for (std::size_t s = 0; s < (apart ? channels : 1); ++s) {
        const DelayLine& line = lines_[block.late.size() > 1 ? s : 0];
        const std::size_t first = line.written() - block_;
        for (std::size_t i = 0; i < block_; ++i) {
            const double w = static_cast<double>(i + 1) / static_cast<double>(block_);
            // An ear hears it so much later in its own time, not in that of the source.
            const double later = (was[s].delay + (pans[s].delay - was[s].delay) * w) * (1 - voice.slope);
            const auto at = [&](double delay) { return line.read(first + i, std::max(0.0, delay + later)); };
            read[i] = block.jumps ? at(voice.delay) * static_cast<float>(w) + at(before) * static_cast<float>(1 - w)
                                  : at(delays[i]);
        }
        if (image.filtered) {
            if (voice.filters.size() <= s) voice.filters.emplace_back(block_, 1).setResponse(image.filter);
            std::fill(heard.begin(), heard.end(), 0.0f);
            voice.filters[s].process(read, heard);
        } else {
            std::swap(heard, read);
        }
        for (std::size_t i = 0; i < block_; ++i) heard[i] *= weights[i];
        for (std::size_t c = apart ? s : 0; c < (apart ? s + 1 : channels); ++c) {
            const double gain = was[c].gain, way = (pans[c].gain - gain) / static_cast<double>(block_);
            for (std::size_t i = 0; i < block_; ++i)
                block.out[c][i] += heard[i] * static_cast<float>(gain + way * static_cast<double>(i + 1));
        }
    }
}

}  // namespace rtsg
