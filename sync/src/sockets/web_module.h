// WebModule and SocketModule: what librtsg_web.so offers, HTTP and WebSockets. Nothing else has to compile the headers
// of its library.
//
// Invariant: this side knows nothing of Boost, and the module links nothing of ours. Errors are sentences.
// Threading: every function may be called on any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace rtsg {

struct WebSettings {
    std::string address;
    std::uint16_t port = 0;
    bool loopback = true;
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

    /// Readable while messages of browsers wait.
    virtual int descriptor() const = 0;
    /// The next message of a browser: the length of its first part (u32), that part, and perhaps a second one. Returns
    /// false if none waits. The browser's next one is read after this.
    virtual bool take(std::uint64_t& browser, std::string& message) = 0;
    /// From now on nobody takes messages.
    virtual void ignore() = 0;
    /// Closes all connections in order, and drops those that do not answer.
    virtual void end() = 0;
    /// Sends one message: `head`, then `second`, which `owner` keeps alive. Returns false if the browser has left.
    virtual bool send(std::uint64_t browser, std::string head, std::span<const std::byte> second,
                      std::shared_ptr<const void> owner) = 0;
};

/// Returns null and the reason if it fails.
using StartWeb = std::unique_ptr<WebModule> (*)(const WebSettings&, std::string& problem);
/// A symbol of the module: a function without arguments that returns a StartWeb.
#define RTSG_WEB_SYMBOL "rtsg_start_web_5"

/// Settings of WebSockets for one protocol, whose messages the module does not read.
struct SocketSettings {
    int listener = -1;       // a socket that listens; the module closes it
    bool loopback = true;    // it listens there, so browsers' requests must name this machine
    bool anyOrigin = false;  // pages of any site may connect; else those of this machine and of `origins`
    std::vector<std::string> origins;
    std::string protocol;  // the subprotocol, which a client must offer
    std::size_t maximumConnections = 0;
    std::size_t longestIncoming = 0;  // bytes of a message; a longer one ends the connection
    std::size_t maxQueued = 0;        // bytes that wait for one client
    std::chrono::milliseconds requestTimeout{0};
    std::chrono::milliseconds silence{0};  // a client that does not even answer pings for so long is dropped
    int call = -1;                         // eventfd, written when there is news
};

struct SocketEvent {
    enum class Kind : std::uint8_t { came, text, bytes, left, refused };
    Kind kind = Kind::came;
    std::uint64_t client = 0;  // each has a number of its own; 0 if it was refused
    std::string text;          // its message, or why it was refused
};

class SocketModule {
  public:
    virtual ~SocketModule() = default;
    virtual std::size_t connections() const = 0;
    /// The events since the last call. A client's next message is read after its last one was taken here.
    virtual std::vector<SocketEvent> takeNews() = 0;
    /// True if a message of so many bytes has room: within the bound, or because nothing waits.
    virtual bool hasRoom(std::uint64_t client, std::size_t bytes) const = 0;
    /// Sends one message, `head` and then `body`, as bytes or as text. False, and nothing is sent, if it has no room or
    /// the client has left.
    virtual bool send(std::uint64_t client, std::string head, std::shared_ptr<const std::string> body, bool bytes) = 0;
};

using StartSockets = std::unique_ptr<SocketModule> (*)(const SocketSettings&, std::string& problem);
#define RTSG_SOCKETS_SYMBOL "rtsg_start_sockets_1"

}  // namespace rtsg
