// --web: lets browsers follow what a verb serves, on a page.
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
    /// Call it before anything starts. Throws UsageError for options that are invalid anywhere or exclude each other.
    void check() const;
};

/// The gateway of a verb, if one was asked for.
class Web {
  public:
    /// `arguments` must be checked. `keys` are the server's and include a client's.
    static Result<Web> start(const WebArguments& arguments, MirrorServer& server,
                             const std::optional<MirrorKeys>& keys);

    /// The address of the page. Empty if there is none.
    std::string url() const { return gateway_ ? gateway_->url() : std::string(); }
    /// Serves what browsers wait for, and prints the gateway's diagnostics.
    void service(const Scene& scene, const Resources& resources);
    /// Call it after the server's end, so that browsers get its goodbye.
    void end() { gateway_.reset(); }

  private:
    std::unique_ptr<WebGateway> gateway_;
};

/// Prints the first lines of a verb: {"endpoint":…,"web":…,"nats":…}, or `words` with the endpoint and then the
/// page's address and that of what is published. `more` goes into the JSON.
void sayEndpoint(const std::string& words, const MirrorServer& server, const Web& web, bool json,
                 const std::string& nats = {}, const std::string& more = {});

}  // namespace rtsg::app
