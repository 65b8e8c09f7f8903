// SoundRenderer: renders the sound that the listener of a scene hears, as one of the renderers of a SharedWorld.
//
// Invariant: sound has been made from the time of attachment to the scene time of the last renderFrame(), however many
// frames passed between two calls. Walls are in the world's ray geometry; data for sound only (sources, materials,
// responses) is here. Figures of rooms are those at the time of the call of measure().
// Threading: as WorldRenderer, except that measure(), room() and finish() are called on the scene's thread while
// nothing else renders; tracing uses all cores. Source: paper section 8 (sound as one more renderer).

// Example:
//     #include <rtsg/audio/sound_renderer.h>
//     #include <rtsg/documents/loader.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     rtsg::SharedWorld world(scene);
//     rtsg::SoundRenderer sound(world);
//     for (int frame = 0; frame < 60; ++frame) {
//         scene.newFrame(frame / 60.0);
//         if (!sound.renderFrame()) break;  // sound.block(): the samples of this frame
//     }
//     const rtsg::ListenReport report = sound.finish();
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <rtsg/audio/listen.h>
#include <rtsg/audio/room_report.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

class SoundRenderer final : public WorldRenderer {
  public:
    /// Called on node renderers once the sound of a frame is made, to add theirs to block().
    static constexpr Operation kVoice{1};

    /// Attaches itself to the world. If that fails, for example because the build has no sound library, attached() is
    /// false and renderFrame() returns the reason. `seconds` and `framesPerSecond` of the options are not used.
    explicit SoundRenderer(SharedWorld& world, const ListenOptions& options = {});
    ~SoundRenderer() override;

    /// Makes the sound from the end of the last frame to the scene's time; does nothing if the options ask for no
    /// sound. Changes of this frame are heard from its time on, rounded to blocks, and positions move smoothly; but the
    /// new walls count from the end of the last frame on. See AcousticEngine::render().
    Result<> renderFrame() override;
    /// The same up to the time of the given state. Error: node renderers are registered, which work on the scene's
    /// thread only.
    Result<> renderFrame(const WorldState& state) override;
    /// The samples of the last renderFrame(), interleaved, and the scene time of the first one.
    std::span<float> block();
    double blockStart() const;
    int channels() const;
    int sampleRate() const;

    /// Sends the results of each Analyser for the sound of the last renderFrame() as events of the scene's next frame:
    /// frequencyBinCount, if it is not half of fftSize, and the `value` of MetadataFloat nodes in its `metadata` (or in
    /// a MetadataSet there). These are named frequencyData (decibels of each bin) or byteFrequencyData (0 to 255 from
    /// minDecibels to maxDecibels). X3D's Analyser has no such fields; the names are those of the Web Audio API. Also
    /// sends `reduction` of each DynamicsCompressor: decibels, at most 0, without make-up gain.
    void sendEvents();

    /// Traces every source in the present state and adds the results to the report.
    Result<> measure();
    /// Traces every source to every place in the present state; without places, to those of the scene
    /// (SoundScene::places()). Places share the rays of a source. Errors: cancelled, no sources.
    Result<RoomReport> survey(std::vector<ListeningPosition> positions = {});
    /// The same at the points of a grid (gridIn()) in the room around the first source: only figures, without
    /// echograms.
    Result<RoomMap> map(double height, double step);
    /// Impulse responses for the pairs of a survey() in the present state, with the channels that the options ask for.
    /// They equal those of impulseResponses() for the same listener and source.
    RoomResponses responses(const RoomReport& report, int sampleRate = 48000, double seconds = 0);
    /// The report so far, with its sound scaled so that it does not clip. Ends the sound. Diagnostics are about sound
    /// only.
    ListenReport finish();

    /// The geometry for sound from `source` in the present state; for the library's own tests
    /// (geometry/world_geometry.h).
    OpenedGeometry room(const glm::dvec3& source);
    /// Precondition: attached().
    const AcousticRenderer& renderer() const;
    std::string failure() const override;
    bool attached() const override { return failure().empty() && WorldRenderer::attached(); }
    std::string subscriberName() const override { return "sound renderer"; }

  protected:
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    std::shared_ptr<const void> freezeTables() override;

  private:
    /// One for each listener; none for an emitter that walls do not reflect.
    Result<std::vector<ListenReport::Source>> measureAt(const SoundEmitter& emitter,
                                                        std::span<const glm::dvec3> listeners);
    enum class Keeps : bool { figures, echograms };
    Result<RoomReport> surveyAt(const std::vector<ListeningPosition>& positions, Keeps keeps);
    /// Describes the room around the first source that walls reflect, and its materials.
    void describeRoom(RoomReport& report);

    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
