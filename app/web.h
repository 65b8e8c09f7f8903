// --web: a page that follows what a verb serves, for browsers.
//
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <string>

#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/web_gateway.h>

#include "command.h"

namespace rtsg::app {

struct WebArguments {
    std::string listen, token, certificate, privateKey;

    void addTo(Command& command);
    bool wanted() const { return !listen.empty(); }
    /// Before anything starts. Throws UsageError for what cannot be served anywhere, or does not go together.
    void check() const;
};

/// The gateway of a verb, if it was asked for.
class Web {
  public:
    /// `arguments`: checked. `keys`: those of the server, with a client's among them.
    static Result<Web> start(const WebArguments& arguments, const MirrorServer& server,
                             const std::optional<MirrorKeys>& keys);

    /// The address of the page; empty if none was asked for.
    std::string url() const { return gateway_ ? gateway_->url() : std::string(); }
    /// Serves what browsers wait for, and prints what is to be said about them.
    void service(const Scene& scene, const Resources& resources);
    /// After the server's end, so that its goodbye gets through.
    void end() { gateway_.reset(); }

  private:
    std::unique_ptr<WebGateway> gateway_;
};

/// The first lines that a verb prints: {"endpoint":…,"web":…}, or as `words` endpoint, and the page's.
void sayEndpoint(const std::string& words, const MirrorServer& server, const Web& web, bool json);

}  // namespace rtsg::app
