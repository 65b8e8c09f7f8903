// WebModule: what librtsg_web.so offers, HTTP and WebSockets. Nothing else has to compile the headers of its library.
//
// Invariant: this side knows nothing of Boost, and the module links nothing of ours. Errors are sentences.
// Threading: every function may be called on any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace rtsg {

struct WebSettings {
    std::string address;
    std::uint16_t port = 0;
    bool loopback = true;
    std::string endpoint, serverKey, publicKey, secretKey;  // empty keys: none
    std::string folder, token;
    std::string certificate, privateKey;  // PEM files; empty: no encryption
    std::size_t maximumConnections = 0;
    std::chrono::milliseconds requestTimeout{0};
    int call = -1;  // eventfd, written when a wish waits
};

struct WebCounts {
    std::size_t connections = 0;
    std::uint64_t opened = 0, requests = 0, refused = 0;
};

/// A file that a browser wants: the url with this index in the field `url` of a node.
struct FileWish {
    enum class Kind : std::uint8_t { picture, sound };
    std::uint64_t number = 0;
    std::uint32_t node = 0, index = 0;
    Kind kind = Kind::picture;
};

class WebModule {
  public:
    virtual ~WebModule() = default;
    virtual std::uint16_t port() const = 0;
    virtual WebCounts counts() const = 0;
    virtual std::vector<std::string> takeNews() = 0;
    /// Each wish must be answered. An empty `type` means that there is no such file.
    virtual std::vector<FileWish> takeWishes() = 0;
    virtual void answer(std::uint64_t wish, std::string bytes, std::string type) = 0;
};

/// Returns null and the reason if it fails.
using StartWeb = std::unique_ptr<WebModule> (*)(const WebSettings&, std::string& problem);
/// The one symbol of the module: a function without arguments that returns a StartWeb.
#define RTSG_WEB_SYMBOL "rtsg_start_web_4"

}  // namespace rtsg
