// Makes the world of a scene when it is first asked for.
#include <rtsg/session/world_on_demand.h>

namespace rtsg {

SharedWorld::Options worldOptions(const Resources& resources) {
    SharedWorld::Options options;
    options.flattening.maxOccurrences = resources.policy().maximumInstances;
    return options;
}

Result<> WorldOnDemand::cut(const TessellationError& error) {
    if (world_ && error.any()) return fail("--tessellation: something else needed the scene's geometry first");
    options_.flattening.error = error;
    return {};
}

std::optional<Flattener::Cuts> WorldOnDemand::cuts() const {
    if (!world_ || !options_.flattening.error.any()) return std::nullopt;
    return world_->flattener().cuts();
}

SharedWorld& WorldOnDemand::get() {
    if (!world_) {
        world_ = std::make_unique<SharedWorld>(scene_, options_);
        context_.extensions().registerWith(*world_);
    }
    return *world_;
}

}  // namespace rtsg
