// Reads SOFA files by libmysofa, and puts what it gives where it belongs in time.
#include <algorithm>
#include <cmath>
#include <mutex>

#include <mysofa.h>

#include <rtsg/audio/hrtf.h>

#include "fractional_delay.h"

namespace rtsg {
namespace {

/// The near ear is at most this much earlier than the middle of the head, and a little of filters' ringing.
constexpr double kEarlySeconds = 0.0006;
/// A response begins where it has this share of its peak.
constexpr float kOnset = 0.1f;

const char* reason(int error) {
    switch (error) {
        case MYSOFA_INVALID_FORMAT:
            return "it is no SOFA file";
        case MYSOFA_UNSUPPORTED_FORMAT:
            return "this kind of SOFA file is not supported";
        case MYSOFA_NO_MEMORY:
            return "it needs more memory than there is";
        case MYSOFA_READ_ERROR:
            return "it cannot be read";
        default:
            return "its contents do not fit together";
    }
}

}  // namespace

struct Hrtf::Impl {
    ~Impl() {
        if (easy) mysofa_close(easy);
    }

    /// Responses as measured, and by how many samples they come late.
    std::array<double, 2> raw(const glm::dvec3& direction, std::array<std::vector<float>, 2>& ears) const {
        for (std::vector<float>& ear : ears) ear.resize(length);
        float left = 0, right = 0;
        const std::lock_guard lock(mutex);  // the library interpolates into a place of its own
        // SOFA's axes: ahead, left, up.
        mysofa_getfilter_float(easy, static_cast<float>(-direction.z), static_cast<float>(-direction.x),
                               static_cast<float>(direction.y), ears[0].data(), ears[1].data(), &left, &right);
        return {static_cast<double>(left) * rate, static_cast<double>(right) * rate};
    }

    MYSOFA_EASY* easy = nullptr;
    mutable std::mutex mutex;
    int rate = 48000;
    std::size_t length = 0;  // of a response
    double lead = 0;         // samples until sound from ahead begins in them
    std::size_t early = 0;
};

Hrtf::Hrtf(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Hrtf::~Hrtf() = default;
int Hrtf::sampleRate() const {
    return impl_->rate;
}
std::size_t Hrtf::early() const {
    return impl_->early;
}

Result<std::shared_ptr<const Hrtf>> Hrtf::load(const std::filesystem::path& file, int sampleRate) {
    auto impl = std::make_unique<Impl>();
    int length = 0, error = MYSOFA_OK;
    std::error_code none;
    if (!std::filesystem::is_regular_file(file, none)) return fail(file.string() + ": there is no such file");
    impl->easy = mysofa_open(file.c_str(), static_cast<float>(sampleRate), &length, &error);
    if (!impl->easy || error != MYSOFA_OK || length <= 0) return fail(file.string() + ": " + reason(error));
    impl->rate = sampleRate;
    impl->length = static_cast<std::size_t>(length);
    impl->early = static_cast<std::size_t>(std::ceil(kEarlySeconds * sampleRate));
    Ears front;
    const auto delays = impl->raw({0, 0, -1}, front);
    double lead = 0;
    for (std::size_t e = 0; e < 2; ++e) {
        float peak = 0;
        for (const float sample : front[e]) peak = std::max(peak, std::abs(sample));
        if (!(peak > 0) || !std::isfinite(peak)) return fail(file.string() + ": it has nothing for sound from ahead");
        const auto onset = std::find_if(front[e].begin(), front[e].end(),
                                        [&](float sample) { return std::abs(sample) >= kOnset * peak; });
        lead += (static_cast<double>(onset - front[e].begin()) + delays[e]) / 2;
    }
    impl->lead = lead;
    return std::shared_ptr<const Hrtf>(new Hrtf(std::move(impl)));
}

Hrtf::Ears Hrtf::at(const glm::dvec3& direction) const {
    static const SincTable sinc;
    const Impl& s = *impl_;
    Ears measured, result;
    const auto delays = s.raw(direction, measured);
    // A millisecond more for an ear that hears late by a delay instead of by its response.
    const auto size = s.length + s.early + static_cast<std::size_t>(0.001 * s.rate) + 2 * SincTable::kHalf;
    for (std::size_t e = 0; e < 2; ++e) {
        result[e].resize(size);
        const double shift = static_cast<double>(s.early) - s.lead + delays[e], whole = std::floor(shift);
        for (std::size_t i = 0; i < s.length; ++i) {
            if (measured[e][i] == 0) continue;
            for (int k = 0; k < 2 * SincTable::kHalf; ++k) {
                const double at = static_cast<double>(i) + whole + k - (SincTable::kHalf - 1);
                if (at >= 0 && at < static_cast<double>(size))
                    result[e][static_cast<std::size_t>(at)] += measured[e][i] * sinc.tap(shift - whole, k);
            }
        }
    }
    return result;
}

}  // namespace rtsg
