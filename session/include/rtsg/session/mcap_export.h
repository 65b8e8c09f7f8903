// McapExport: writes what SceneMessages tells of a scene as an MCAP file, for Foxglove and other viewers.
//
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <string>

#include <rtsg/core/scene.h>
#include <rtsg/renderers/shared_world.h>
#include <rtsg/session/scene_messages.h>
#include <rtsg/sync/mcap.h>

namespace rtsg {

class McapExport {
  public:
    /// Follows the world, which must outlive this.
    static Result<std::unique_ptr<McapExport>> attach(SharedWorld& world, const std::string& file,
                                                      McapOptions options = {});

    /// Why it no longer follows; empty if it does.
    std::string failure() const { return messages_->failure(); }
    Result<> finish();

  private:
    class Sink;
    McapExport() = default;
    std::unique_ptr<McapWriter> writer_;
    std::unique_ptr<MessageSink> sink_;
    std::unique_ptr<SceneMessages> messages_;  // last: it uses the others
};

}  // namespace rtsg
