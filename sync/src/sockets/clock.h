// MirrorClock: the server's clock as seen from here, and how evenly frames arrive.
//
// Invariant: of the last 32 exchanges the one with the shortest round trip counts (as in NTP's clock filter, RFC 5905,
// section 10). Its offset is wrong by at most half the round trip. Both clocks are steady, so changes of the time of
// day do no harm.
// Threading: values.
#pragma once

#include <array>
#include <cstdint>

namespace rtsg {

class MirrorClock {
  public:
    /// Takes one exchange, with times in ns: when we asked and when the answer came, on our clock, and the server's
    /// time in between.
    void sample(std::uint64_t asked, std::uint64_t theirs, std::uint64_t answered);
    /// Forgets everything, because the server is another one.
    void reset() { *this = {}; }
    bool known() const { return count_ > 0; }
    std::uint64_t samples() const { return count_; }
    /// In seconds: the server's clock minus ours, and the round trip, of the exchange that counts.
    double offset() const { return best_.offset; }
    double delay() const { return best_.delay; }
    /// The time of our clock, in ns, when the server's shows `theirs`.
    std::uint64_t here(std::uint64_t theirs) const;

    /// Notes that a frame has arrived which was published at `published` on the server's clock. Updates the jitter.
    void arrival(std::uint64_t published, std::uint64_t arrived);
    double jitter() const { return jitter_; }

  private:
    struct Sample {
        double offset = 0, delay = 0;
    };
    std::array<Sample, 32> samples_{};
    Sample best_;
    std::uint64_t count_ = 0;
    std::int64_t transit_ = 0;
    bool seen_ = false;
    double jitter_ = 0;
};

}  // namespace rtsg
