// Follows the sound of a scene, and hands out versions of its tables.
#include "acoustic_tables.h"

namespace rtsg {

AcousticTables::AcousticTables(const RayWorld& world, const AcousticMaterial& defaults, Resources resources,
                               bool keepsStreams, std::shared_ptr<const MaterialTable> materials)
    : walls_(world, defaults), sounds_(&walls_, defaults, std::move(resources), keepsStreams, std::move(materials)) {}

Result<> AcousticTables::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    sounds_.apply(scene, changes, delta);
    walls_.apply(delta, [&](const Instance& instance) { return sounds_.materialNode(scene, instance); });
    sequence_ = delta.sequence;
    latest_.reset();
    return {};
}

std::shared_ptr<const AcousticState> AcousticTables::latest() {
    if (!latest_) latest_ = std::make_shared<const AcousticState>(sequence_, sounds_.freeze(), walls_.freeze());
    return latest_;
}

}  // namespace rtsg
