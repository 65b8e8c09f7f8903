// Reads SOFA files by libmysofa, and puts what it gives where it belongs in time.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include <mysofa.h>

#include <rtsg/audio/hrtf.h>

#include "fractional_delay.h"

namespace rtsg {
namespace {

/// The near ear is at most this much earlier than the middle of the head, and a little of filters' ringing; and what a
/// delay line needs that reads between samples.
constexpr double kEarlySeconds = 0.0006;
/// A response begins where it has this share of its peak.
constexpr float kOnset = 0.1f;

/// Sound goes past any head in less.
constexpr float kLongestDelay = 1;  // s

/// Samples and delays that are no numbers would be in sound from their directions alone, where nobody would find why:
/// returns what is wrong.
const char* unfit(const MYSOFA_HRTF& hrtf, int sampleRate) {
    const float longest = kLongestDelay * static_cast<float>(sampleRate);
    for (const float delay : std::span(hrtf.DataDelay.values, hrtf.DataDelay.elements))
        if (!(std::abs(delay) <= longest)) return "it has delays that are not those of a head";
    for (const float sample : std::span(hrtf.DataIR.values, hrtf.DataIR.elements))
        if (!std::isfinite(sample)) return "it has samples that are no numbers";
    return nullptr;
}

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

    /// The measured direction that is next to one, which goes where it can be compared: the library's own search takes
    /// from the heap.
    int nearestTo(std::array<float, 3>& place) const {
        const float size = std::sqrt(place[0] * place[0] + place[1] * place[1] + place[2] * place[2]);
        const float radius = std::clamp(size, easy->lookup->radius_min, easy->lookup->radius_max);
        if (size > 0)
            for (float& x : place) x *= radius / size;
        const float* at = easy->hrtf->SourcePosition.values;
        unsigned nearest = 0;
        float least = std::numeric_limits<float>::infinity();
        for (unsigned m = 0; m < easy->hrtf->M; ++m, at += 3) {
            const float x = at[0] - place[0], y = at[1] - place[1], z = at[2] - place[2];
            const float squared = x * x + y * y + z * z;
            if (squared < least) least = squared, nearest = m;
        }
        return static_cast<int>(nearest);
    }

    /// Responses as measured, left and then right in `length` samples of `room` each or elsewhere, and by how many
    /// samples they come late.
    std::array<double, 2> raw(const glm::dvec3& direction, float* room, const float*& responses) const {
        // SOFA's axes: ahead, left, up.
        std::array<float, 3> place{static_cast<float>(-direction.z), static_cast<float>(-direction.x),
                                   static_cast<float>(direction.y)};
        const int nearest = nearestTo(place);
        std::array<float, 2> delays{};
        responses = mysofa_interpolate(easy->hrtf, place.data(), nearest,
                                       mysofa_neighborhood(easy->neighborhood, nearest), room, delays.data());
        // In samples, as files have them (AES69, Data.Delay), of the rate that was asked for: the library's manual says
        // seconds.
        return {static_cast<double>(delays[0]), static_cast<double>(delays[1])};
    }

    MYSOFA_EASY* easy = nullptr;
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
    if (const char* const why = unfit(*impl->easy->hrtf, sampleRate)) return fail(file.string() + ": " + why);
    impl->rate = sampleRate;
    impl->length = static_cast<std::size_t>(length);
    impl->early = static_cast<std::size_t>(std::ceil(kEarlySeconds * sampleRate)) + 3 * SincTable::kHalf;
    std::vector<float> room(2 * impl->length);
    const float* front = nullptr;
    const auto delays = impl->raw({0, 0, -1}, room.data(), front);
    double lead = 0;
    for (std::size_t e = 0; e < 2; ++e) {
        const std::span ear(front + e * impl->length, impl->length);
        float peak = 0;
        for (const float sample : ear) peak = std::max(peak, std::abs(sample));
        if (!(peak > 0) || !std::isfinite(peak)) return fail(file.string() + ": it has nothing for sound from ahead");
        const auto onset =
            std::find_if(ear.begin(), ear.end(), [&](float sample) { return std::abs(sample) >= kOnset * peak; });
        lead += (static_cast<double>(onset - ear.begin()) + delays[e]) / 2;
    }
    impl->lead = lead;
    return std::shared_ptr<const Hrtf>(new Hrtf(std::move(impl)));
}

Hrtf::Ears Hrtf::at(const glm::dvec3& direction) const {
    Ears ears;
    at(direction, ears);
    return ears;
}

void Hrtf::at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>& earlier) const {
    static const SincTable sinc;
    const Impl& s = *impl_;
    // A millisecond more for an ear that hears late by a delay instead of by its response.
    const auto size = s.length + s.early + static_cast<std::size_t>(0.001 * s.rate) + 3 * SincTable::kHalf;
    // What was measured lies behind what is made of it for the left ear.
    for (std::vector<float>& ear : ears) ear.assign(size + 2 * s.length, 0.0f);
    const float* measured = nullptr;
    const auto delays = s.raw(direction, ears[0].data() + size, measured);
    for (std::size_t e = 0; e < 2; ++e) {
        const double shift = static_cast<double>(s.early) - s.lead + delays[e] - earlier[e], whole = std::floor(shift);
        std::array<float, 2 * SincTable::kHalf> taps;
        for (std::size_t k = 0; k < taps.size(); ++k) taps[k] = sinc.tap(shift - whole, static_cast<int>(k));
        const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(whole) - (SincTable::kHalf - 1);
        for (std::size_t i = 0; i < s.length; ++i) {
            const float sample = measured[e * s.length + i];
            if (sample == 0) continue;
            const std::ptrdiff_t start = first + static_cast<std::ptrdiff_t>(i);
            const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, -start);
            const auto to = std::min(std::ssize(taps), static_cast<std::ptrdiff_t>(size) - start);
            for (std::ptrdiff_t k = from; k < to; ++k)
                ears[e][static_cast<std::size_t>(start + k)] += sample * taps[static_cast<std::size_t>(k)];
        }
    }
    for (std::vector<float>& ear : ears) ear.resize(size);
}

}  // namespace rtsg
