// Heads that were measured: reads SOFA files by libmysofa.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include <mysofa.h>

#include <rtsg/audio/hrtf.h>

#include "fractional_delay.h"
#include "hrtf_impl.h"
#include "panning.h"
#include "sound_libraries.h"

namespace rtsg {
namespace {

/// The near ear is at most this much earlier than the middle of the head, including some ringing of filters and the
/// margin of a delay line that reads between samples.
constexpr double kEarlySeconds = 0.0006;
/// A response begins where it has this share of its peak.
constexpr float kOnset = 0.1f;

/// Sound goes past any head in less.
constexpr float kLongestDelay = 1;  // s

/// Samples and delays that are not finite would be heard from their directions only, and hard to trace back. Returns
/// the fault.
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

class SofaHead final : public Hrtf::Impl {
  public:
    ~SofaHead() override {
        if (easy) mysofa_close(easy);
    }

    /// The measured direction that is next to one, which goes where it can be compared: the library's own search takes
    /// from the heap.
    int nearestTo(std::array<float, 3>& position) const {
        const float size = std::sqrt(position[0] * position[0] + position[1] * position[1] + position[2] * position[2]);
        const float radius = std::clamp(size, easy->lookup->radius_min, easy->lookup->radius_max);
        if (size > 0)
            for (float& x : position) x *= radius / size;
        const float* at = easy->hrtf->SourcePosition.values;
        unsigned nearest = 0;
        float minimum = std::numeric_limits<float>::infinity();
        for (unsigned m = 0; m < easy->hrtf->M; ++m, at += 3) {
            const float x = at[0] - position[0], y = at[1] - position[1], z = at[2] - position[2];
            const float squared = x * x + y * y + z * z;
            if (squared < minimum) minimum = squared, nearest = m;
        }
        return static_cast<int>(nearest);
    }

    std::array<double, 2> raw(const glm::dvec3& direction, float* room, const float*& responses) const override {
        // SOFA's axes: ahead, left, up.
        std::array<float, 3> position{static_cast<float>(-direction.z), static_cast<float>(-direction.x),
                                      static_cast<float>(direction.y)};
        const int nearest = nearestTo(position);
        std::array<float, 2> delays{};
        responses = mysofa_interpolate(easy->hrtf, position.data(), nearest,
                                       mysofa_neighborhood(easy->neighborhood, nearest), room, delays.data());
        // In samples, as files have them (AES69, Data.Delay), of the rate that was asked for: the library's manual says
        // seconds.
        return {static_cast<double>(delays[0]), static_cast<double>(delays[1])};
    }

    MYSOFA_EASY* easy = nullptr;
};

}  // namespace

Result<std::shared_ptr<const Hrtf>> Hrtf::load(const std::filesystem::path& file, int sampleRate) {
    auto impl = std::make_unique<SofaHead>();
    int length = 0, error = MYSOFA_OK;
    std::error_code none;
    if (std::filesystem::is_directory(file, none)) return fail(file.string() + ": it is a folder, not a SOFA file");
    if (!std::filesystem::is_regular_file(file, none)) return fail(file.string() + ": there is no such file");
    if (const auto loaded = delayed::sound.load(); !loaded) return std::unexpected(loaded.error());
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
    // At least as much as a line needs to read between samples.
    impl->sphereSeconds = kHeadRadius / 343;
    impl->lineDelay = SincTable::kHalf + 1 + impl->sphereSeconds * sampleRate;
    return std::shared_ptr<const Hrtf>(new Hrtf(std::move(impl)));
}

}  // namespace rtsg
