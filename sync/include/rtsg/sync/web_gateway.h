// WebGateway: serves the page of sync/js/page by HTTP, and connects each browser that shows it to a mirror server.
//
// Invariant: it passes messages on without reading them. Messages from a WebSocket go to the server as those of a
// client, and the server's messages go back (PROTOCOL.md, "Browsers"), so credit, merging, requests and limits are
// those of any mirror; the bytes of a record are not copied. It serves the files of the page's folder, and pictures and
// sounds that nodes of the scene name. Beyond loopback it asks for a token; on loopback it refuses pages of other
// origins. start() loads HTTP and WebSocket (Boost.Beast) as the module librtsg_web.so. Threading: a thread of its own;
// service() on the scene's thread, all other functions on any.

// Example:
//     #include <rtsg/sync/mirror_server.h>
//     #include <rtsg/sync/web_gateway.h>
//     rtsg::Scene scene;
//     const auto server = rtsg::MirrorServer::start(scene, "tcp://127.0.0.1:*");
//     if (!server) return;
//     rtsg::WebGatewayOptions options;
//     options.listen = "8080";
//     const auto gateway = rtsg::WebGateway::start(**server, options);
//     if (!gateway) return;  // gateway.error() says why
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/sync/mirror_keys.h>
#include <rtsg/sync/mirror_server.h>

namespace rtsg {

class WebModule;

struct WebGatewayOptions {
    /// "8080" is that port on loopback; "ADDRESS:8080" or "[::]:8080" can be reached by others. Port 0 is any free
    /// port.
    std::string listen = "0";
    /// If the server has keys: those of a client of it, whose permission browsers have.
    std::optional<MirrorKeys> keys;
    /// The folder of the page. Empty: it is beside the module, or in the source tree.
    std::filesystem::path folder;
    /// The token that a browser must send. Empty: none on loopback; elsewhere one is generated.
    std::string token;
    /// PEM files: the server's certificate with its chain, and its private key. Give both, or neither for unencrypted
    /// traffic.
    std::filesystem::path certificate, privateKey;
    /// MirrorServer::callDescriptor(); it is then also readable when service() of the gateway has something to do. -1:
    /// none.
    int call = -1;
    /// The most browsers at once.
    std::size_t maximumConnections = 32;
    /// The time for a request to be complete, for its file to come, and for the answer to be taken. Then the connection
    /// is closed.
    std::chrono::milliseconds requestTimeout{20000};

    /// Errors that do not depend on the machine: `listen` is no address; the token has fewer than 16 characters, or
    /// others than letters, digits, '-' and '_'; only one of certificate and key is given.
    Result<> check() const;
};

struct WebGatewayStatistics {
    std::size_t connections = 0;  // open WebSockets
    std::uint64_t opened = 0;     // WebSockets opened so far
    std::uint64_t requests = 0;   // requests for files
    std::uint64_t refused = 0;    // refused WebSockets and requests, whatever the reason
};

class WebGateway {
  public:
    /// Binds, and lets browsers follow the server from now on. Errors: as check(); no module; an address that cannot be
    /// used; no page in the folder; an invalid certificate or key.
    static Result<std::unique_ptr<WebGateway>> start(MirrorServer& server, WebGatewayOptions options);
    /// Closes the connections in order, and drops those that do not answer. End the mirror server first, so that
    /// browsers get its goodbye.
    ~WebGateway();
    WebGateway(const WebGateway&) = delete;
    WebGateway& operator=(const WebGateway&) = delete;

    /// The address to open in a browser, with the token.
    const std::string& url() const { return url_; }
    WebGatewayStatistics statistics() const;
    /// Lets browsers load the files that textures and sound sources of the scene name and `resources` can open: PNG,
    /// JPEG, GIF and WebP; WAVE, Ogg, FLAC, MP3 and MP4; at most 32 MiB each. Call it between frames on the scene's
    /// thread. Without it the page has no textures and no sound.
    void service(const Scene& scene, const Resources& resources);

    /// The refusals since the last call, at most a hundred sentences. They leave out the token, which readers of logs
    /// must not learn.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    WebGateway() = default;
    std::shared_ptr<WebModule> module_;
    std::string url_;
};

}  // namespace rtsg
