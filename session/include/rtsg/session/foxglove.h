// Foxglove: a scene for live viewers, as Foxglove and Lichtblick are.
//
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <rtsg/feeds/foxglove_server.h>
#include <rtsg/session/scene_messages.h>
#include <rtsg/session/world_on_demand.h>

namespace rtsg {

class Foxglove {
  public:
    struct Settings {
        bool insecure = false;  // addresses that others reach are allowed
        int call = -1;          // eventfd, written when a viewer asks for something
    };
    /// Begins to serve at `listen`, PORT on loopback or ADDRESS:PORT; not if that is empty: the scene and its `fields`
    /// ("DOOR.rotation,BOX.*"), from the world's present state on.
    static Result<Foxglove> start(const std::string& listen, const std::vector<std::string>& fields,
                                  WorldOnDemand& world, const Settings& settings, const SessionContext& context);
    /// Call it before a frame, which then tells viewers what they have asked for; nothing is done if nobody is served.
    void before();
    /// Call it after a frame. What was refused is reported.
    void after();
    /// "ws://127.0.0.1:8765"; empty if nobody is served.
    std::string address() const { return server_ ? server_->address() : std::string(); }
    /// True if a viewer waits for what had no room yet, or came too soon: after() may tell it soon.
    bool owes() const { return server_ && server_->owesWhole(); }
    FoxgloveCounts counts() const { return server_ ? server_->counts() : FoxgloveCounts(); }
    /// Says goodbye. Error: why the scene was not followed to its end.
    Result<> end();

  private:
    SessionContext context_;
    std::unique_ptr<FoxgloveServer> server_;
    std::unique_ptr<MessageSink> sink_;
    std::unique_ptr<SceneMessages> messages_;  // goes first
    double reported_ = -1;
};

/// "DOOR.rotation,BOX.*" as its parts.
std::vector<std::string> fieldsIn(const std::vector<std::string>& texts);

}  // namespace rtsg
