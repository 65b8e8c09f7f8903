// Cones and ellipsoids of an emitter as a pattern of what it sends.
#include "source_pattern.h"

#include <algorithm>

namespace rtsg {

SourcePattern patternOf(const SoundEmitter& emitter, const glm::dvec3& source, const glm::dvec3& listener,
                        bool levels) {
    const SoundNode& sound = *emitter.sound;
    if (!sound.directional(levels)) return {};
    const double distance = glm::distance(source, listener);
    const double reference = levels ? sound.level(emitter.localFrom(listener - source)) : 1;
    if (!(reference > 0)) return {};
    return [emitter, distance, reference, levels](const glm::dvec3& direction) {
        const glm::dvec3 local = emitter.localFrom(direction * std::max(distance, 1e-3));
        const double amplitude =
            emitter.sound->coneGain(local) * (levels ? emitter.sound->level(local) / reference : 1);
        return amplitude * amplitude;
    };
}

}  // namespace rtsg
