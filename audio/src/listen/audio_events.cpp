// Sends spectra and reductions, in the form of the Web Audio API, to their nodes.
#include "audio_events.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <rtsg/core/x3d.h>

namespace rtsg {
namespace {

/// A level as a byte of the Web Audio API: 0 at `low` and below, 255 at `high`.
float byteOf(double decibels, double low, double high) {
    const double scaled = std::floor(255 / (high - low) * (decibels - low));
    return high > low && std::isfinite(scaled) ? static_cast<float>(std::clamp(scaled, 0.0, 255.0)) : 0.0f;
}

void sendSpectrum(Scene& scene, NodeId metadata, const Node& analyser, const AudioSpectrum& spectrum, int depth = 0) {
    using A = x3d::Analyser;
    const Node* node = scene.find(metadata);
    if (!node || depth > 8) return;
    if (node->is(x3d::MetadataSet::type)) {
        const Array<NodeId> children = node->get(x3d::MetadataSet::value);
        for (const NodeId child : children) sendSpectrum(scene, child, analyser, spectrum, depth + 1);
        return;
    }
    if (!node->is(x3d::MetadataFloat::type)) return;
    const std::string_view name = node->get(x3d::MetadataFloat::name).view();
    if (name != "frequencyData" && name != "byteFrequencyData") return;
    const bool bytes = name == "byteFrequencyData";
    const auto low = static_cast<double>(analyser.get(A::minDecibels)),
               high = static_cast<double>(analyser.get(A::maxDecibels));
    std::vector<float> values;
    // Silence has no level in decibels: as low as single precision goes.
    constexpr double kSilence = std::numeric_limits<float>::lowest();
    for (const double level : spectrum.decibels)
        values.push_back(bytes ? byteOf(level, low, high) : static_cast<float>(std::max(level, kSilence)));
    static_cast<void>(
        scene.sendEvent(metadata, x3d::MetadataFloat::value.index, Value(Array<float>(std::move(values)))));
}

}  // namespace

void sendAudioEvents(Scene& scene, const AudioFindings& found) {
    using C = x3d::DynamicsCompressor;
    for (const AudioSpectrum& spectrum : found.spectra) {
        const Node* node = scene.find(spectrum.node);
        if (!node || !node->is(x3d::Analyser::type)) continue;
        const auto bins = static_cast<std::int32_t>(spectrum.decibels.size());
        if (node->get(x3d::Analyser::frequencyBinCount) != bins)
            static_cast<void>(scene.sendEvent(spectrum.node, x3d::Analyser::frequencyBinCount.index, Value(bins)));
        sendSpectrum(scene, node->get(x3d::Analyser::metadata), *node, spectrum);
    }
    for (const AudioReduction& reduction : found.reductions) {
        const Node* node = scene.find(reduction.node);
        const auto metered = static_cast<float>(reduction.decibels);
        // An output takes no events: the node's behaviour sends it when it finds another value here.
        if (node && node->is(C::type) && node->get(C::_metered) != metered)
            static_cast<void>(scene.set(reduction.node, C::_metered, metered));
    }
}

}  // namespace rtsg
