// SceneMessages: what viewers of robots' recordings are told of a scene that something else runs, as JSON on topics:
//
//   /tf                  foxglove.FrameTransforms: where each shape, light, viewpoint and sound is, as a frame below
//                        "world"
//   /scene               foxglove.SceneUpdate: each shape in its frame, as a cube, sphere, cylinder or triangles, in
//   its
//                        colour
//   /rtsg/changes        rtsg.Changes: every frame with its hash and every change in it
//   /fields/NODE/FIELD   the values of chosen fields
//
// A frame costs what changed in it, and of topics that nobody wants nothing. For more than some hundred shapes a
// complete message comes once a second of scene time, or when the sink wants one.
// Invariant: time stamps are scene time and never go back. Scale and shear are in /scene, because frames only turn and
// move. Viewers that jump get the last message of each topic, so an incomplete message is followed by a complete one
// within seconds. Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

/// Where messages go: a file, or live viewers.
class MessageSink {
  public:
    enum class Reach : std::uint8_t {
        change,       // what has changed
        wholeForAll,  // all there is
        wholeForNew,  // all there is, and nothing has changed
    };
    virtual ~MessageSink() = default;
    /// `isState`: a message says what has changed since the one before.
    virtual Result<std::uint16_t> addTopic(std::string_view topic, std::string_view schemaName, std::string_view schema,
                                           bool isState) = 0;
    virtual bool wants(std::uint16_t topic) = 0;
    /// True if a message of all there is should come with the next frame, or with offer().
    virtual bool wantsWhole(std::uint16_t topic) = 0;
    /// `time` in seconds, >= 0, and not before that of the last message.
    virtual Result<> write(std::uint16_t topic, double time, std::string json, Reach reach) = 0;
};

class SceneMessages {
  public:
    /// Follows the world from its present state on; both must outlive this. `fields`: "DEF.field", or "DEF.*" for all
    /// fields of a node; of another world they are looked for again. Errors: no such node or field; what the sink says.
    static Result<std::unique_ptr<SceneMessages>> attach(SharedWorld& world, MessageSink& sink,
                                                         const std::vector<std::string>& fields = {});
    ~SceneMessages();

    /// Gives all there is to a sink that wants it, while nothing changes.
    Result<> offer();
    /// The time of the last message, or that of a message at the scene's present time.
    double time() const;
    /// Why it no longer follows; empty if it does.
    std::string failure() const;
    void detach();

  private:
    struct Impl;
    explicit SceneMessages(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
