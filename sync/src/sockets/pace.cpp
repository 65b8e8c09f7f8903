// Measures what the link to a peer carries, and tells how much may be under way.
#include "pace.h"

#include <algorithm>

namespace rtsg {

namespace {

constexpr double kHeadroom = 1.25;                  // without it a rate that was measured too low would stay low
constexpr double kFirst = 8 << 10, kMin = 2 << 10;  // bytes under way: at first, and in any case,
constexpr double kFew = 256;                        // and fewer if a slow link takes longer for them than the lag
constexpr double kSmallRecord = 16 << 10;           // a record of this size may always be under way as a whole,
constexpr double kLargeRecord = 64 << 10;           // and one of this size if the link takes it within the lag
constexpr double kMaxSpared = 128 << 10;            // bytes without immediate acknowledgement, if that is a short time
constexpr double kShortest = 1e-4;                  // s; shorter measurements are noise
constexpr MirrorPace::Seconds kRateSpan{1}, kDelaySpan{5};
constexpr double kSpanDelays = 8;  // or this many delays, if that is longer
constexpr int kRateKnown = 4;      // acknowledgements before the first delay can be judged

double smallestOf(double a, double b) {
    return a <= 0 ? b : b <= 0 ? a : std::min(a, b);
}

}  // namespace

double MirrorPace::rate() const {
    const double measured = std::max(rate_.now, rate_.before);
    return maximum_ > 0 && measured > 0 ? std::min(maximum_, measured) : measured;
}

double MirrorPace::delay() const {
    return smallestOf(delay_.now, delay_.before);
}

double MirrorPace::limit(std::uint64_t record) const {
    if (lag_ <= 0) return std::numeric_limits<double>::infinity();
    if (rate() <= 0) return kFirst;
    // If a record is sent in one part, the next can wait until it has arrived.
    const double whole =
        double(record) <= kMin ? 0 : std::min(double(record), std::clamp(rate() * lag_, kSmallRecord, kLargeRecord));
    const double minimum = std::clamp(rate() * lag_ / 4, kFew, kMin);
    return std::max({minimum, whole, kHeadroom * rate() * (delay() + lag_ / 8)});
}

bool MirrorPace::open(std::uint64_t record, Clock::time_point now) {
    if (maximum_ > 0 && now < next_) return false;
    const std::uint64_t all = sentTotal_ - acknowledgedTotal_, under = all - std::min(all, spared_);
    // At the end no more is added than passes while the goodbye is awaited, or than the systems take at once.
    if (lifted_ && double(sentTotal_ - liftedAt_) < std::clamp(rate(), kSmallRecord, kLargeRecord)) return true;
    if (draining_) draining_ = all != 0;
    return !draining_ && (under == 0 || double(under) < limit(record));
}

/// True if the link is known and has recently carried all that there was to send.
bool MirrorPace::settled(Clock::time_point now) const {
    const bool probes = delay_.now <= 0 && sentTotal_ == acknowledgedTotal_;  // with a part that is alone under way
    if (draining_ || lifted_ || probes || delay() <= 0 || rate() <= 0 || Seconds(now - heldAt_).count() < lag_)
        return false;
    const auto awaited = std::ranges::find(sent_, 0u, &Sent::spared);
    return awaited == sent_.end() || Seconds(now - awaited->at).count() <= lag_ / 2;
}

/// Bytes that have not arrived yet, if the link is as fast as measured.
double MirrorPace::inFlight(Clock::time_point now) const {
    return std::max(0., inFlight_ - rate() * Seconds(now - inFlightAt_).count());
}

/// Single frames rarely use all that a link can carry. So some more small ones may go unacknowledged.
double MirrorPace::maxSpared() const {
    return rate() * std::max(lag_ / 2, std::min(2 * lag_, kMaxSpared / rate()));
}

bool MirrorPace::spare(std::uint64_t size, Clock::time_point now) const {
    if (maximum_ > 0) return false;  // held back by that limit and not by missing credit
    if (lag_ <= 0) return true;
    return settled(now) && inFlight(now) + double(size) <= rate() * lag_ / 2 && double(spared_ + size) <= maxSpared() &&
           (sent_.empty() || Seconds(now - sent_.front().at).count() <= 2 * lag_);
}

std::uint64_t MirrorPace::chunk(std::uint64_t maximum, Clock::time_point now) const {
    double result = double(maximum);
    // Parts measure the link. Once it is known, the parts of a record that passes in time only cost.
    if (lag_ > 0) {
        const double minimum = settled(now) ? std::min(kSmallRecord, rate() * lag_) : kMin;
        result = std::min(result, std::max({kMin, minimum, limit(0) / 4}));
    }
    if (maximum_ > 0) result = std::min(result, std::max(kMin, maximum_ / 20));  // a twentieth of a second
    return static_cast<std::uint64_t>(result);
}

void MirrorPace::sent(std::uint64_t total, Clock::time_point now, bool awaited) {
    const std::uint64_t size = total - sentTotal_;
    if (maximum_ > 0)
        next_ = std::max(next_, now) + std::chrono::duration_cast<Clock::duration>(Seconds(double(size) / maximum_));
    if (lag_ > 0) {
        const bool alone = sentTotal_ == acknowledgedTotal_;
        if (alone) acknowledgedAt_ = now;
        // Only for a part so short that its own time does not hide the delay.
        const bool measures = alone && awaited && size <= static_cast<std::uint64_t>(std::max(kMin, limit(0) / 4));
        sent_.push_back({total, acknowledgedTotal_, now, acknowledgedAt_, measures, awaited ? 0 : size});
        spared_ += sent_.back().spared;
        inFlight_ = inFlight(now) + double(size);
        inFlightAt_ = now;
    }
    sentTotal_ = total;
}

/// `size` is that of the part sent alone; the link needed time for it, too.
void MirrorPace::learnDelay(const Sent& sent, std::uint64_t size, Clock::time_point now) {
    const double whole = Seconds(now - sent.at).count();
    const double own = rate() > 0 ? double(size) / rate() : 0;
    delay_.now = smallestOf(delay_.now, std::max(kShortest, whole - own));
    draining_ = false;
    if (rate() <= 0) unjudged_ = double(size);
}

/// The first delay was measured before the rate was known, so it may be mostly the time that the link took for those
/// bytes. In that case the link is left to run empty and the delay is measured again.
void MirrorPace::judgeFirstDelay() {
    if (unjudged_ <= 0 || rate() <= 0 || ++judged_ < kRateKnown) return;
    if (unjudged_ / rate() > .25 * delay()) {
        delay_.now = delay_.before = 0;
        draining_ = true;
    }
    unjudged_ = 0;
}

void MirrorPace::learnRate(const Sent& sent, Clock::time_point now) {
    const double seconds = std::max(kShortest, Seconds(now - sent.since).count());
    const double found = double(acknowledgedTotal_ - sent.acknowledgedThen) / seconds;
    // A sample limited by the sender only shows that the link carries at least that much.
    const bool links = sent.total <= heldUpTo_;
    if (links && now - rate_.began > std::max(kRateSpan, Seconds(kSpanDelays * delay()))) {
        rate_.before = rate_.now;
        rate_.now = 0;
        rate_.began = now;
    }
    if (links || found > rate()) rate_.now = std::max(rate_.now, found);
}

void MirrorPace::acknowledged(std::uint64_t total, Clock::time_point now) {
    if (total <= acknowledgedTotal_) return;
    std::uint64_t before = acknowledgedTotal_;
    acknowledgedTotal_ = total;
    while (!sent_.empty() && sent_.front().total <= total) {
        const Sent chunk = sent_.front();
        sent_.pop_front();
        spared_ -= chunk.spared;
        if (chunk.measures) learnDelay(chunk, chunk.total - before, now);
        before = chunk.total;
        if (sent_.empty() || sent_.front().total > total) learnRate(chunk, now);
    }
    judgeFirstDelay();
    acknowledgedAt_ = now;
    inFlight_ = std::min(inFlight(now), double(sentTotal_ - acknowledgedTotal_));
    inFlightAt_ = now;
    if (lag_ > 0 && now - delay_.began > kDelaySpan) {
        // The empty link was not measured in all this time, so it must be made empty.
        draining_ = delay_.now <= 0;
        if (!draining_) delay_.before = delay_.now;
        delay_.now = 0;
        delay_.began = now;
    }
}

}  // namespace rtsg
