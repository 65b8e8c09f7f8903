// WebGateway: the page of sync/js/page by HTTP, and for each browser that shows it a connection to a mirror server.
//
// Invariant: it looks into nothing. What comes by a WebSocket goes to the server as a client's messages, and back
// (PROTOCOL.md, "Browsers"): so credit, merging, requests and limits are those of any mirror. Files are those of the
// page's folder, and pictures and sounds that nodes of the scene name. Beyond loopback a token is asked for; on
// loopback, pages of other origins are refused. HTTP and WebSocket come from Boost.Beast, in a module (librtsg_web.so)
// that is loaded by start(). Threading: a thread of its own; service() on the scene's, all other functions from any.

// Example:
//     #include <rtsg/sync/mirror_server.h>
//     #include <rtsg/sync/web_gateway.h>
//     rtsg::Scene scene;
//     const auto server = rtsg::MirrorServer::start(scene, "tcp://127.0.0.1:*");
//     if (!server) return;
//     rtsg::WebGatewayOptions options;
//     options.listen = "8080";
//     options.endpoint = (*server)->endpoint();
//     const auto gateway = rtsg::WebGateway::start(options);
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

namespace rtsg {

class WebModule;

struct WebGatewayOptions {
    /// "8080": that port on loopback; "ADDRESS:8080", "[::]:8080": where others reach it. Port 0 is any free one.
    std::string listen = "0";
    /// The mirror server's, and what a client of it needs, if it has keys.
    std::string endpoint;
    std::optional<MirrorKeys> keys;
    /// Of the page; empty: beside the module, or in the source tree.
    std::filesystem::path folder;
    /// What a browser has to know. Empty: nothing on loopback, else one is made up.
    std::string token;
    /// PEM files: the server's certificate with those that vouch for it, and its private key. Both, or neither: then
    /// pages and messages go in the clear.
    std::filesystem::path certificate, privateKey;
    /// MirrorServer::callDescriptor(), which is readable then when service() has something to do; -1: none.
    int call = -1;
    /// Browsers at once.
    std::size_t maximumConnections = 32;
    /// For a request to be whole, for its file to come, and for the answer to be taken; then the connection ends.
    std::chrono::milliseconds requestTimeout{20000};

    /// What is wrong with it on any machine: `listen` is no place, the token is shorter than 16 or has other characters
    /// than letters, digits, '-' and '_', of certificate and key one is missing.
    Result<> check() const;
};

struct WebGatewayStatistics {
    std::size_t connections = 0;  // WebSockets now
    std::uint64_t opened = 0;     // and ever
    std::uint64_t requests = 0;   // of files
    std::uint64_t refused = 0;    // of either, whatever the reason
};

class WebGateway {
  public:
    /// Binds and begins to serve. Errors: as check(); no module, an address that cannot be had, no page in the folder,
    /// a certificate or key that is none.
    static Result<std::unique_ptr<WebGateway>> start(WebGatewayOptions options);
    /// Ends the connections in order, and those that do not answer without it. End the mirror server first: its goodbye
    /// then gets through.
    ~WebGateway();
    WebGateway(const WebGateway&) = delete;
    WebGateway& operator=(const WebGateway&) = delete;

    /// What to open in a browser, the token in it.
    const std::string& url() const { return url_; }
    WebGatewayStatistics statistics() const;
    /// Gives browsers what textures and sound sources of the scene name, as far as `resources` open it: PNG, JPEG, GIF
    /// and WebP; WAVE, Ogg, FLAC, MP3 and MP4; at most 32 MiB each. Call it between frames, on the scene's thread;
    /// without it the page has no pictures in its textures, and is silent.
    void service(const Scene& scene, const Resources& resources);

    /// What was refused since the last call, at most a hundred sentences. They name the page without the token, which
    /// is nothing for those who read logs.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    WebGateway() = default;
    std::unique_ptr<WebModule> module_;
    std::string url_;
};

}  // namespace rtsg
