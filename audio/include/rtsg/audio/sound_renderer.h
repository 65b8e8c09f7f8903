// SoundRenderer: what the listener of a scene hears, as one of the renderers of a SharedWorld.
//
// Invariant: sound has been made up to the scene time of the last renderFrame(), from the time it was attached on,
// however many frames went by between two calls. Walls are where the world's rays meet them; what sound needs alone
// (sources, materials, responses) is here. Figures of rooms are those of the moment measure() is called.
// Threading: as WorldRenderer, but for measure(), room() and finish(): the scene's thread, and not while another
// renders; tracing uses all cores. Source: paper section 8 (sound as one more renderer).

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
#include <rtsg/audio/room_map.h>
#include <rtsg/audio/room_report.h>
#include <rtsg/audio/room_responses.h>
#include <rtsg/renderers/world_renderer.h>

namespace rtsg {

class SoundRenderer final : public WorldRenderer {
  public:
    /// Asked of node renderers once a frame's sound is made: to add theirs to block().
    static constexpr Operation kVoice{1};

    /// Attached on return; if that failed, for want of a sound library say, attached() is false and renderFrame() says
    /// why. Of the options, `seconds` and `framesPerSecond` are not used.
    explicit SoundRenderer(SharedWorld& world, const ListenOptions& options = {});
    ~SoundRenderer() override;

    /// Makes the sound from the end of the last frame to the scene's time; nothing where the options ask for no sound.
    /// Changes of this frame are heard from its time on, to the block, and things move there smoothly; but walls count
    /// from the end of the last frame on. See AcousticEngine::render().
    Result<> renderFrame() override;
    /// The same up to the state's time, with what the state has. Errors: node renderers are registered here, which
    /// voice on the scene's thread only.
    Result<> renderFrame(const WorldState& state) override;
    /// The samples that the last renderFrame() made, interleaved, and the scene time of the first.
    std::span<float> block();
    double blockStart() const;
    int channels() const;
    int sampleRate() const;

    /// Sends what each Analyser finds in the sound of the last renderFrame(), as events of the scene's next frame:
    /// frequencyBinCount, where it is not half of fftSize, and the `value` of MetadataFloat nodes in its `metadata` (or
    /// in a MetadataSet there) that are named frequencyData: decibels of each bin, byteFrequencyData: 0 to 255 from
    /// minDecibels to maxDecibels. X3D's Analyser has no fields for these; they are those of its model, the Web Audio
    /// API. And `reduction` of each DynamicsCompressor: decibels, at most 0, without what makes up for them.
    void sendEvents();

    /// Traces every source at the present state and adds it to the report.
    Result<> measure();
    /// Traces every source to every place, or if none is given to those of the scene (SoundScene::places()), at the
    /// present state; places share the rays of a source. Errors: cancelled, no sources.
    Result<RoomReport> survey(std::vector<ListeningPlace> places = {});
    /// The same at the points of a grid (gridIn()) of the room around the first source, which are in its order: figures
    /// alone, without echograms.
    Result<RoomMap> map(double height, double step);
    /// Impulse responses of the pairs of a survey() at the present state, with the channels that the options ask for:
    /// those of impulseResponses() where listener and source are the same.
    RoomResponses responses(const RoomReport& report, int sampleRate = 48000);
    /// The report so far, with the sound made not to clip. Ends the sound. Its diagnostics are those of sounds alone.
    ListenReport finish();

    /// The geometry that sound from `source` meets at present.
    OpenedGeometry room(const glm::dvec3& source);
    /// Precondition: it could be attached.
    const AcousticRenderer& renderer() const;
    std::string failure() const override;
    bool attached() const override { return failure().empty() && WorldRenderer::attached(); }
    std::string subscriberName() const override { return "sound renderer"; }

  protected:
    Result<> follow(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) override;
    std::shared_ptr<const void> freezeTables() override;

  private:
    /// One a listener; none for an emitter that walls do not reflect.
    Result<std::vector<ListenReport::Source>> measureAt(const SoundEmitter& emitter,
                                                        std::span<const glm::dvec3> listeners);
    enum class Keeps : bool { figures, echograms };
    Result<RoomReport> surveyAt(const std::vector<ListeningPlace>& places, Keeps keeps);
    /// The room around the first source that walls reflect, and what it is made of.
    void describeRoom(RoomReport& report);

    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
