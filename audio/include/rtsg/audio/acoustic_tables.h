// AcousticTables: what sound must know of a scene, as versions that any thread may render from.
//
//     AcousticTables tables(world, {});                     // on the scene's thread, fed after the world
//     std::shared_ptr<const AcousticState> now = tables.latest();
//     engine->render(*now, *world.freeze(), t, sound);      // on any thread, with rays of the same state
//
// Invariant: a version never changes, needs no scene, and is that of one ChangeSet. Following costs what changed; a
// version costs two pointers, and a copy of the emitters when these changed since the last.
// Threading: all members on the scene's thread; what latest() gave may be read from any.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/audio/sound_scene.h>
#include <rtsg/audio/walls.h>
#include <rtsg/renderers/flattener.h>

namespace rtsg {

/// One version.
struct AcousticState {
    std::uint64_t sequence = 0;  // of the (last) ChangeSet in it
    SoundVersion sounds;
    WallsVersion walls;
};

class AcousticTables final : public InstanceSubscriber {
  public:
    /// `world` must outlive this, and be applied the same deltas, before this is. `defaults`: of surfaces without
    /// AcousticProperties. `resources`: where urls of clips start. `keepsStreams`, `materials`: as SoundScene has them.
    explicit AcousticTables(const RayWorld& world, const AcousticMaterial& defaults = {}, Resources resources = {},
                            bool keepsStreams = false, std::shared_ptr<const MaterialTable> materials = nullptr);

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// latest(), as an AcousticState, for readers of the whole world's state.
    std::shared_ptr<const void> freeze() override { return latest(); }

    /// The state as of the last apply(); the same one until the next.
    std::shared_ptr<const AcousticState> latest();
    const SoundScene& scene() const { return sounds_; }
    /// The node that says a material, by AcousticHit::material; none of the default one.
    NodeId nodeOfMaterial(std::uint32_t material) const { return walls_.nodeOf(material); }

  private:
    Walls walls_;
    SoundScene sounds_;
    std::uint64_t sequence_ = 0;
    std::shared_ptr<const AcousticState> latest_;
};

}  // namespace rtsg
