// AcousticTables: the data of a scene that sound needs, as versions that any thread may render from.
//
//     AcousticTables tables(world, {});                     // on the scene's thread, fed after the world
//     std::shared_ptr<const AcousticState> now = tables.latest();
//     engine->render(*now, *world.freeze(), t, sound);      // on any thread, with rays of the same state
//
// Invariant: a version never changes, does not need the scene, and is that of one ChangeSet. The work of an update
// depends on what has changed. A version costs two pointers, and a copy of the emitters if they have changed since the
// last version.
// Threading: all members on the scene's thread; a state from latest() may be read on any thread.
#pragma once

#include <cstdint>
#include <memory>

#include <rtsg/audio/sound_scene.h>
#include <rtsg/renderers/flattener.h>

#include "walls/walls.h"

namespace rtsg {

/// One version.
struct AcousticState {
    std::uint64_t sequence = 0;  // of the (last) ChangeSet in it
    SoundVersion sounds;
    WallsVersion walls;
};

class AcousticTables final : public InstanceSubscriber {
  public:
    /// `world` must outlive this object, and must be given each delta before this object is. `defaults`: for surfaces
    /// without AcousticProperties. `resources`: for the urls of clips. `keepsStreams`, `materials`: as in SoundScene.
    explicit AcousticTables(const RayWorld& world, const AcousticMaterial& defaults = {}, Resources resources = {},
                            bool keepsStreams = false, std::shared_ptr<const MaterialTable> materials = nullptr);

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// latest() for readers that hold the state of the whole world.
    std::shared_ptr<const void> freeze() override { return latest(); }

    /// The state as of the last apply(). It stays the same object until the next apply().
    std::shared_ptr<const AcousticState> latest();
    const SoundScene& scene() const { return sounds_; }
    /// The node that defines a material, by AcousticHit::material; none for the default material.
    NodeId nodeOfMaterial(std::uint32_t material) const { return walls_.nodeOf(material); }

  private:
    Walls walls_;
    SoundScene sounds_;
    std::uint64_t sequence_ = 0;
    std::shared_ptr<const AcousticState> latest_;
};

}  // namespace rtsg
