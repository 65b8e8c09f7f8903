// The server's clock as seen from here, and how evenly frames come.
//
// Invariant: of the last 32 exchanges the one with the shortest round trip counts (as in NTP's clock filter, RFC 5905,
// section 10): its offset is wrong by at most half that. Both clocks are steady, so clock jumps of either machine do no
// harm. Threading: values.
#pragma once

#include <array>
#include <cstdint>

namespace rtsg {

class MirrorClock {
  public:
    /// Times in ns: when asked and when answered on our clock, and the server's in between.
    void sample(std::uint64_t asked, std::uint64_t theirs, std::uint64_t answered);
    /// Another server: what was known of the last one's clock means nothing.
    void reset() { *this = {}; }
    bool known() const { return count_ > 0; }
    std::uint64_t samples() const { return count_; }
    /// Seconds: theirs less ours, and the round trip of the sample that counts.
    double offset() const { return best_.offset; }
    double delay() const { return best_.delay; }
    /// Our clock's time, in ns, when theirs shows `theirs`.
    std::uint64_t here(std::uint64_t theirs) const;

    /// A frame published at `published` on their clock has arrived. Updates jitter.
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
