// Chooses the maker that options ask for.
#include <rtsg/session/output_maker.h>

#include "outputs/behind.h"
#include "outputs/live_outputs.h"
#include "outputs/outputs.h"
#include "outputs/tile_outputs.h"

namespace rtsg {

Result<std::unique_ptr<OutputMaker>> makeOutputs(WorldOnDemand& world, const OutputOptions& options,
                                                 const Resources& resources) {
    if (options.isLive()) return LiveOutputs::attach(world, options, resources);
    return Outputs::attach(world, options, resources);
}

Result<std::unique_ptr<OutputMaker>> followOutputs(const Scene& scene, const OutputOptions& options,
                                                   const Resources& resources) {
    if (!options.tiles.empty()) return TileOutputs::attach(scene, options, resources);
    return std::make_unique<OutputsBehind>(scene, options, resources);
}

}  // namespace rtsg
