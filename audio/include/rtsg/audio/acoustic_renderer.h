// AcousticRenderer: AcousticTables and an AcousticEngine on one live world, for programs with a single thread.
//
// SoundRenderer does the same on a SharedWorld. Call render() when the scene has reached the time up to which sound is
// wanted.
// Threading: the scene's thread. To render on another thread, use the two parts. Tracing uses all cores.
#pragma once

#include <memory>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/audio/acoustic_tables.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>

namespace rtsg {

class AcousticRenderer final : public InstanceSubscriber {
  public:
    using Options = AcousticOptions;
    using Levels = AcousticOptions::Levels;

    /// `world` must outlive this object, and must be given each delta before this object is.
    static Result<std::unique_ptr<AcousticRenderer>> create(const RayWorld& world, const Options& options);
    ~AcousticRenderer() override;

    Result<> apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;

    /// AcousticEngine::render() with the state and the rays of the latest apply().
    Result<> render(double untilSeconds, SoundBuffer& sound);
    /// The same with a given state, on any one thread.
    Result<> render(const AcousticState& state, const RayView& rays, double untilSeconds, SoundBuffer& sound) {
        return engine_->render(state, rays, untilSeconds, sound);
    }
    std::shared_ptr<const AcousticState> latest() { return tables_.latest(); }
    int channels() const { return engine_->channels(); }
    const SoundScene& scene() const { return tables_.scene(); }
    NodeId nodeOfMaterial(std::uint32_t material) const { return tables_.nodeOfMaterial(material); }
    OpenedGeometry geometryFor(const glm::dvec3& source);
    /// The air that results from the options and the scene.
    Air air();
    const HeardResponses& heard() const { return engine_->heard(); }
    const std::vector<StreamedSound>& streams() const { return engine_->streams(); }
    AudioFindings analyse() { return engine_->analyse(); }
    /// Responses traced so far.
    std::uint64_t traces() const { return heard().responses; }
    Diagnostics diagnostics() const;
    const std::vector<SealedSource>& sealed() const { return engine_->sealed(); }
    void note(const SoundEmitter& emitter, const glm::dvec3& listener, double seconds, std::optional<Seal> seal) {
        engine_->note(emitter, listener, seconds, std::move(seal));
    }
    std::vector<UnheardSource> unheard() const { return engine_->unheard(); }
    const std::vector<SoundLeak>& leaks() const { return engine_->leaks(); }
    void note(const SoundEmitter& emitter, const RoomOpenings& openings) { engine_->note(emitter, openings); }

  private:
    AcousticRenderer(const RayWorld& world, const Options& options, std::unique_ptr<AcousticEngine> engine);

    AcousticTables tables_;
    const RayWorld* rays_;
    std::unique_ptr<AcousticEngine> engine_;
};

}  // namespace rtsg
