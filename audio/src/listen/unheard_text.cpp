// Texts about sounds that were never heard: out of reach, switched off, or not shown.
#include "unheard_text.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "scene/sound_fields.h"

namespace rtsg {
namespace {

std::string whyText(const UnheardSource& source) {
    constexpr double kNowhere = 1e9;
    switch (source.why) {
        case UnheardSource::Why::off:
            return "it is not enabled";
        case UnheardSource::Why::empty:
            return "nothing that sounds leads into it";
        case UnheardSource::Why::silent:
            return "its intensity or its gain is 0";
        case UnheardSource::Why::deaf:
            return "the gain of the listener is 0";
        case UnheardSource::Why::still:
            return "what leads into it made no sound in that time (a clip plays once, from its startTime on)";
        case UnheardSource::Why::far:
            break;
    }
    if (!(source.nearest < kNowhere)) return "it is at no place";
    return fmt::format("the listener is out of its reach{}{}, {:.4g} m away at the nearest",
                       source.reach.empty() ? "" : ": ", source.reach, source.nearest);
}

}  // namespace

void reportUnheard(const Scene& scene, std::span<const UnheardSource> unheard, Diagnostics& diagnostics) {
    // Says nothing of an empty source whose reason has been reported.
    if (!diagnostics.all().empty() && std::ranges::all_of(unheard, [](const UnheardSource& source) {
            return source.why == UnheardSource::Why::empty || source.why == UnheardSource::Why::still;
        }))
        return;
    constexpr std::size_t kMax = 8;
    for (const UnheardSource& source : unheard.first(std::min(kMax, unheard.size())))
        diagnostics.warningAt(scene.find(source.sound) ? scene.locationOf(source.sound) : NodeLocation(),
                              fmt::format("nothing is heard of {}: {}", source.name, whyText(source)));
    if (unheard.size() > kMax)
        diagnostics.warning({}, fmt::format("nor is anything heard of {} more sounds", unheard.size() - kMax));
}

void reportNoSounds(const Scene& scene, Diagnostics& diagnostics) {
    const Node* first = nullptr;
    std::size_t count = 0;
    scene.forEachNode([&](const Node& node) {
        if (!node.is(x3d::Sound::type) && !node.is(x3d::SpatialSound::type) && !node.is(x3d::AudioDestination::type))
            return;
        if (count++ == 0) first = &node;
    });
    if (!first) return diagnostics.warning({}, "the scene has no sounds");
    diagnostics.warningAt(scene.locationOf(first->id()),
                          fmt::format("nothing is heard of {}{}: it was never in what is shown (a Switch or LOD may "
                                      "leave it out)",
                                      nameOf(scene, *first),
                                      count > 1 ? fmt::format(" and the scene's {} other sounds", count - 1) : ""));
}

}  // namespace rtsg
