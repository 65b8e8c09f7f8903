// Reads what a source played at the delays of its images.
#include "engine/image_player.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "signal/fade.h"

namespace rtsg {
namespace {

/// The least delay up to which played sound is kept for images that come later, seconds.
constexpr double kKept = 0.15;

}  // namespace

void ImagePlayer::Voice::restart() {
    started = false;
    for (Convolver& filter : filters) filter.restart();
    filtersInUse = 0;
    weights = weightsBefore = {};
    head.restart();
    for (PoleBank& bank : banks) bank.restart();
    fraction = 0;
}

void ImagePlayer::Set::start(Images what, const StraightPath& known) {
    images = std::move(what);
    straight = known;
    if (voices.size() < count()) voices.resize(count());
    for (std::size_t k = 0; k < count(); ++k) voices[k].restart();
}

double ImagePlayer::openNext() const {
    const double is = current_.straight.open;
    if (!fading_ && !waits_) return is;
    if (!started_) return waitingStraight_.open;
    const std::size_t length = fading_ ? fadeSamples_ : onceIn_ > 0 ? onceIn_ : fade_;
    const double done = static_cast<double>((fading_ ? faded_ : 0) + block_) / static_cast<double>(length);
    const double comes = fading_ ? next_.straight.open : waitingStraight_.open;
    return is + (comes - is) * static_cast<double>(fadeIn(done));
}

void ImagePlayer::scaleOpen(double factor) {
    for (StraightPath* straight : {&current_.straight, &next_.straight, &waitingStraight_})
        straight->open = std::min(1.0, straight->open * factor);
}

void ImagePlayer::setOpen(double open) {
    for (StraightPath* straight : {&current_.straight, &next_.straight, &waitingStraight_}) straight->open = open;
}

void ImagePlayer::render(const Block& block) {
    double longest = kKept * block.response.sampleRate;
    for (const Set* set : {&current_, &next_})
        for (std::size_t k = 0; k < set->count(); ++k)
            longest = std::max(longest, set->voices[k].delay + 2 * static_cast<double>(block_));
    for (std::size_t k = 0; k < block.late.size(); ++k)
        lines_[k].write(block.late[k], static_cast<std::size_t>(longest) + 64);
    while (static_cast<double>(reflected_.size() * block_) > longest + static_cast<double>(block_))
        reflected_.dropFirst();
    reflected_.push_back(block.reflects);
    // The rule is that of Convolver::process().
    if (!fading_ && waits_) {
        // The first ones, too, fade in where the lines hold sound already.
        if (!started_) current_.straight = waitingStraight_;
        next_.start(std::exchange(waiting_, nullptr), waitingStraight_);
        waits_ = false;
        fading_ = started_ || static_cast<double>(silent_) < longest;
        if (!fading_) std::swap(current_, next_);
        started_ = true;
        faded_ = 0;
        fadeSamples_ = onceIn_ > 0 ? std::exchange(onceIn_, 0) : fade_;
    }
    const bool sounds = std::ranges::any_of(block.late, [](const auto& late) {
        return std::ranges::any_of(late, [](float sample) { return sample != 0; });
    });
    silent_ = sounds ? 0 : std::min(silent_, kLongAgo) + block_;
    render(current_, block, false);
    if (!fading_) return;
    render(next_, block, true);
    faded_ += block_;
    if (faded_ < fadeSamples_) return;
    std::swap(current_, next_);
    next_.images = nullptr;
    fading_ = false;
}

void ImagePlayer::render(Set& set, const Block& block, bool arrives) {
    if (set.count() == 0) return;
    weights_.assign(block_, 1.0f);
    if (fading_)
        for (std::size_t i = 0; i < block_; ++i) {
            const float fraction = fadeIn(static_cast<double>(faded_ + i + 1) / static_cast<double>(fadeSamples_));
            weights_[i] = arrives ? fraction : 1 - fraction;
        }
    for (std::size_t k = 0; k < set.count(); ++k) render((*set.images)[k], set.voices[k], block);
}

/// By sample; cubic between the computed points.
void ImagePlayer::findDelays(const FollowedImage& image, Voice& voice, const Block& block) {
    delays_.resize(block_);
    double from = voice.delay, slope = voice.slope;
    int step = 0;
    for (std::size_t at = 0; at < block_; ++step) {
        const std::size_t next = std::min(block_, at + kStep);
        const double h = static_cast<double>(next - at);
        double delay = from + slope * h, after = 0;
        block.find(image, step, delay, after);
        const double distance = delay - from, a = slope * h, b = after * h;
        for (std::size_t i = at; i < next; ++i) {
            const double u = static_cast<double>(i + 1 - at) / h;
            delays_[i] = from + u * (a + u * (3 * distance - 2 * a - b + u * (a + b - 2 * distance)));
        }
        from = delay, slope = after;
        at = next;
    }
    voice.delay = from;
    voice.slope = slope;
}

/// Block::reflects at the end of a block that long ago, samples; between blocks evenly.
double ImagePlayer::reflectedBefore(double delay) const {
    const double blocks = std::min(delay / static_cast<double>(block_), static_cast<double>(reflected_.size() - 1));
    const auto whole = static_cast<std::size_t>(blocks);
    const double rest = blocks - static_cast<double>(whole), last = reflected_[reflected_.size() - 1 - whole];
    return whole + 1 < reflected_.size() ? last + (reflected_[reflected_.size() - 2 - whole] - last) * rest : last;
}

/// The factor for samples of the line. A wave by way of an edge belongs to the direct sound that is heard beside it.
double ImagePlayer::amplitudeOf(const FollowedImage& image, const Voice& voice, double distance,
                                const Block& block) const {
    constexpr double kMax = 100;
    if (image.kind == FollowedImage::Kind::edge) {
        const double then = reflectedBefore(voice.delay);
        return then != 0 ? std::clamp(block.reflects / then, -kMax, kMax) : 1;
    }
    const double pressure = (image.filtered ? 1 : image.pressure) / std::max(distance, 0.01);
    return image.kind == FollowedImage::Kind::boundary ? pressure * voice.fraction : pressure;
}

/// Finds the gains and delays for its direction at the end of the block: by channel, or by ear of a head.
void ImagePlayer::panVoice(const FollowedImage& image, Voice& voice, bool fresh, const Block& block) const {
    glm::dvec3 from(0);
    if (image.kind == FollowedImage::Kind::edge) {
        const EdgeEnds ends = block.ends(voice.delay);
        from = edgePath(image.edge->route, ends.source, ends.listener).last - ends.listener;
        voice.weightsBefore = voice.weights;
        image.edge->weightsAt(ends.source, ends.listener, block.heard, voice.weights);
        if (fresh) voice.weightsBefore = voice.weights;
    } else {
        from = block.from(image, voice.delay);
    }
    const double distance = glm::length(from);
    const glm::dvec3 direction = distance > 0 ? from / distance : glm::dvec3(0, 0, -1);
    const double amplitude = amplitudeOf(image, voice, distance, block);
    std::swap(voice.before, voice.pans);
    const ImpulseResponseOptions& r = block.response;
    if (!block.ears.empty()) {
        voice.pans.assign(2, {amplitude, 0});
        voice.head.setDirection(*r.hrtf, inListenersFrame(direction, r), block_);
    } else {
        voice.pans.resize(block.out.size());
        for (std::size_t c = 0; c < voice.pans.size(); ++c) {
            voice.pans[c] = panOf(direction, static_cast<int>(c), r);
            voice.pans[c].gain *= amplitude;
            voice.pans[c].delay *= r.sampleRate;
        }
    }
    if (!fresh) return;
    voice.before = voice.pans;
    if (image.kind == FollowedImage::Kind::boundary)
        for (ArrivalPan& pan : voice.before) pan.gain = 0;
}

/// Reads played sound as channel `channel` hears it into `read_`. `before` is the delay with which the block begins,
/// and `ahead` says how many samples earlier all is read.
void ImagePlayer::readLine(const DelayLine& line, const Voice& voice, double before, std::size_t channel, bool jumps,
                           double ahead) {
    const std::size_t first = line.written() - block_;
    const double was = voice.before[channel].delay, is = voice.pans[channel].delay;
    const auto fraction = [&](std::size_t i) { return static_cast<double>(i + 1) / static_cast<double>(block_); };
    read_.resize(block_);
    later_.resize(block_);
    // An ear hears it so much later in its own time, not in that of the source.
    for (std::size_t i = 0; i < block_; ++i) later_[i] = (was + (is - was) * fraction(i) - ahead) * (1 - voice.slope);
    if (!jumps) {
        for (std::size_t i = 0; i < block_; ++i) later_[i] = std::max(0.0, delays_[i] + later_[i]);
        line.read(first, later_, read_);
        return;
    }
    for (std::size_t i = 0; i < block_; ++i) {
        const auto at = [&](double delay) { return line.read(first + i, std::max(0.0, delay + later_[i])); };
        read_[i] = at(voice.delay) * static_cast<float>(fraction(i)) + at(before) * static_cast<float>(1 - fraction(i));
    }
}

/// Whether nothing is heard of the image by a face, as it was right all the time; else its share of now is known.
bool ImagePlayer::isSilent(const FollowedImage& image, Voice& voice, const Block& block) const {
    // Approximately the position of the source when it sent the sound that arrives now.
    const EdgeEnds now = block.ends(0);
    const double distance = glm::distance(image.at(now.source), now.listener);
    const EdgeEnds ends = block.ends(distance / image.edge->speedOfSound * block.response.sampleRate);
    const double fraction = image.edge->boundaryGain(image.face, ends.source, ends.listener);
    const bool silent = fraction == 0 && voice.fraction == 0;
    if (silent && voice.started) voice.restart();
    voice.fraction = fraction;
    return silent;
}

/// Filters the samples in `read_` into `heard_`.
void ImagePlayer::filter(const FollowedImage& image, Voice& voice, std::size_t signal, const Block& block) {
    heard_.assign(block_, 0.0f);
    if (image.kind == FollowedImage::Kind::edge) {
        if (voice.banks.size() <= signal) voice.banks.emplace_back(block.response.sampleRate);
        voice.banks[signal].process(read_, voice.weightsBefore, voice.weights, heard_);
    } else if (image.filtered) {
        if (voice.filters.size() <= signal) voice.filters.emplace_back(block_, 1);
        if (voice.filtersInUse <= signal) voice.filters[voice.filtersInUse++].setResponse(image.filter);
        voice.filters[signal].process(read_, heard_);
    } else {
        std::swap(heard_, read_);
    }
}

void ImagePlayer::render(const FollowedImage& image, Voice& voice, const Block& block) {
    if (image.kind == FollowedImage::Kind::boundary && isSilent(image, voice, block)) return;
    const bool fresh = !std::exchange(voice.started, true), head = !block.ears.empty();
    const double ahead = image.kind == FollowedImage::Kind::edge ? PoleBank::kAhead : 0;
    if (fresh) block.find(image, -1, voice.delay, voice.slope);
    const double before = voice.delay;
    findDelays(image, voice, block);
    panVoice(image, voice, fresh, block);
    // One signal for all channels, unless these hear others, or each at its time.
    const std::size_t channels = voice.pans.size();
    const bool apart = block.late.size() > 1 || block.response.channels == ImpulseResponseOptions::Channels::binaural;
    for (std::size_t s = 0; s < (apart ? channels : 1); ++s) {
        readLine(lines_[block.late.size() > 1 ? s : 0], voice, before, s, block.jumps, ahead);
        filter(image, voice, s, block);
        for (std::size_t i = 0; i < block_; ++i) heard_[i] *= weights_[i];
        for (std::size_t c = apart ? s : 0; c < (apart ? s + 1 : channels); ++c) {
            const double gain = voice.before[c].gain,
                         distance = (voice.pans[c].gain - gain) / static_cast<double>(block_);
            if (head)
                for (std::size_t i = 0; i < block_; ++i)
                    heard_[i] *= static_cast<float>(gain + distance * static_cast<double>(i + 1));
            else
                for (std::size_t i = 0; i < block_; ++i)
                    block.out[c][i] += heard_[i] * static_cast<float>(gain + distance * static_cast<double>(i + 1));
        }
        if (head) voice.head.process(s, heard_, block.ears[s]);
    }
}

}  // namespace rtsg
