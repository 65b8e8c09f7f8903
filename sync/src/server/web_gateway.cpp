// Finds and loads the module that serves browsers, tells where it listens, and brings their messages to the server.
#include <rtsg/sync/web_gateway.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <random>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>

#include <rtsg/core/module.h>

#include "sockets/web_module.h"
#include "transport/transport.h"

namespace rtsg {

namespace {

struct Endpoint {
    std::string address = "127.0.0.1";
    std::uint16_t port = 0;
};

Result<Endpoint> endpointFrom(const std::string& text) {
    Endpoint endpoint;
    const std::size_t colon = text.rfind(':');
    const std::string port = colon == std::string::npos ? text : text.substr(colon + 1);
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), endpoint.port);
    if (error != std::errc() || end != port.data() + port.size())
        return fail(fmt::format("'{}' is no place to serve browsers at: expected PORT or ADDRESS:PORT", text));
    if (colon == std::string::npos) return endpoint;
    endpoint.address = text.substr(0, colon);
    if (endpoint.address.size() > 2 && endpoint.address.front() == '[' && endpoint.address.back() == ']')
        endpoint.address = endpoint.address.substr(1, endpoint.address.size() - 2);
    if (endpoint.address == "localhost") endpoint.address = "127.0.0.1";
    if (endpoint.address == "*") endpoint.address = "0.0.0.0";
    return endpoint;
}

bool isLoopback(const std::string& address) {
    return address == "::1" || address.starts_with("127.");
}

/// The name by which other machines reach this one, if it listens on all addresses: the first address that is not
/// loopback.
std::string ownAddress() {
    std::string found = "localhost";
    ifaddrs* all = nullptr;
    if (getifaddrs(&all) != 0) return found;
    for (const ifaddrs* a = all; a; a = a->ifa_next) {
        const unsigned wanted = IFF_UP | IFF_RUNNING;
        if (!a->ifa_addr || a->ifa_addr->sa_family != AF_INET) continue;
        if ((a->ifa_flags & wanted) != wanted || (a->ifa_flags & IFF_LOOPBACK)) continue;
        sockaddr_in address;
        std::memcpy(&address, a->ifa_addr, sizeof(address));
        char text[INET_ADDRSTRLEN];
        if (inet_ntop(AF_INET, &address.sin_addr, text, sizeof(text))) found = text;
        break;
    }
    freeifaddrs(all);
    return found;
}

std::string randomToken() {
    std::random_device device;
    std::string token;
    for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", device());
    return token;
}

/// A character has six bits; a shorter token could be guessed.
constexpr std::size_t kShortestToken = 16;

bool isToken(const std::string& text) {
    return (text.empty() || text.size() >= kShortestToken) && std::ranges::all_of(text, [](char c) {
               return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
                      c == '_';
           });
}

Result<StartWeb> loadWeb() {
#ifdef RTSG_NO_WEB
    return fail("browsers are not served: this build leaves it out (RTSG_WEB=OFF)");
#else
    const auto symbol = rtsg::loadModule("rtsg_web", RTSG_WEB_SYMBOL, "serving browsers needs");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<StartWeb (*)()>(*symbol)();
#endif
}

constexpr std::size_t kLargestNamed = std::size_t{32} << 20;

/// Looks at the content and not at the name. Empty for formats that browsers do not show.
std::string pictureType(std::string_view bytes) {
    if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return "image/png";
    if (bytes.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
    if (bytes.starts_with("GIF87a") || bytes.starts_with("GIF89a")) return "image/gif";
    if (bytes.size() > 12 && bytes.starts_with("RIFF") && bytes.substr(8, 4) == "WEBP") return "image/webp";
    return {};
}

/// The same for formats that browsers play: WAVE, Ogg, FLAC, MP4, MP3 (after tags, or from a frame of layer III on).
std::string soundType(std::string_view bytes) {
    if (bytes.size() < 12) return {};
    if (bytes.starts_with("RIFF") && bytes.substr(8, 4) == "WAVE") return "audio/wav";
    if (bytes.starts_with("OggS")) return "audio/ogg";
    if (bytes.starts_with("fLaC")) return "audio/flac";
    if (bytes.substr(4, 4) == "ftyp") return "audio/mp4";
    const bool frame = bytes[0] == '\xFF' && (bytes[1] & '\xE6') == '\xE2';
    if (frame || bytes.starts_with("ID3")) return "audio/mpeg";
    return {};
}

/// True if nodes of this type have files of this kind.
bool names(const NodeType& type, FileWish::Kind kind) {
    if (kind == FileWish::Kind::picture) return type.isA("X3DTextureNode");
    return type.isA("X3DSoundSourceNode") && !type.isA("X3DTextureNode");
}

/// Opens only files that the scene names. A browser only says which node.
std::string fileOf(const Scene& scene, const Resources& resources, const FileWish& wish) {
    const Node* node = scene.find(NodeId{wish.node});
    if (!node || !names(node->type(), wish.kind)) return {};
    const FieldIndex field = node->type().find("url");
    if (field == kNoField || node->type().fields[field].type != FieldType::MFString) return {};
    const Value urls = node->value(field);
    const auto& all = urls.as<Array<String>>();
    if (wish.index >= all.size()) return {};
    auto resource = resources.open(scene, *node, field, all[wish.index].view());
    if (!resource) return {};
    auto bytes = resource->read();
    return bytes && bytes->size() <= kLargestNamed ? std::move(*bytes) : std::string();
}

}  // namespace

Result<> WebGatewayOptions::check() const {
    if (const auto at = endpointFrom(listen); !at) return std::unexpected(at.error());
    if (!isToken(token))
        return fail(fmt::format("a token is made of {} letters, digits, '-' and '_' or more", kShortestToken));
    if (certificate.empty() != privateKey.empty())
        return fail("encryption needs a certificate and its private key, not one of them");
    return {};
}

namespace {

/// Messages of browsers, which are one WebSocket message each: the length of the first part, that part, the second.
class WebListener : public Listener {
  public:
    WebListener(std::shared_ptr<WebModule> module, std::string url, std::string user)
        : module_(std::move(module)), url_(std::move(url)), user_(std::move(user)) {}
    ~WebListener() override { module_->ignore(); }

    const std::string& endpoint() const override { return url_; }
    Clock::duration prepare(Items items, bool) override {
        items[0] = {module_->descriptor(), POLLIN, 0};
        for (std::size_t i = 1; i < kDescriptors; ++i) items[i] = {-1, 0, 0};
        return std::chrono::hours(1);
    }
    bool came(Items items) override { return items[0].revents != 0; }
    bool receive(Received& message) override {
        std::uint64_t browser = 0;
        if (!module_->take(browser, taken_)) return false;
        std::uint32_t length = 0;
        const auto bytes = std::as_bytes(std::span(taken_));
        std::memcpy(&length, bytes.data(), sizeof(length));
        message.from = std::to_string(browser);
        message.user = user_;
        message.problem = nullptr;
        message.first = bytes.subspan(sizeof(length), length);
        message.second = bytes.subspan(sizeof(length) + length);
        return true;
    }
    Failures received(bool) override { return {}; }
    bool send(std::string_view to, std::span<const std::byte> first, std::span<const std::byte> second,
              const SharedBytes& owner) override {
        std::uint64_t browser = 0;
        std::from_chars(to.data(), to.data() + to.size(), browser);
        const auto length = static_cast<std::uint32_t>(first.size());
        std::string head(sizeof(length), '\0');
        std::memcpy(head.data(), &length, sizeof(length));
        head.append(reinterpret_cast<const char*>(first.data()), first.size());
        if (owner) return module_->send(browser, std::move(head), second, owner);
        head.append(reinterpret_cast<const char*>(second.data()), second.size());
        return module_->send(browser, std::move(head), {}, nullptr);
    }

  private:
    const std::shared_ptr<WebModule> module_;
    const std::string url_, user_;
    std::string taken_;
};

}  // namespace

Result<std::unique_ptr<WebGateway>> WebGateway::start(MirrorServer& server, WebGatewayOptions options) {
    if (auto ok = options.check(); !ok) return std::unexpected(ok.error());
    const auto endpoint = endpointFrom(options.listen);
    WebSettings settings;
    settings.certificate = options.certificate.string();
    settings.privateKey = options.privateKey.string();
    settings.address = endpoint->address;
    settings.port = endpoint->port;
    settings.loopback = isLoopback(endpoint->address);
    if (options.keys)
        if (auto ok = options.keys->checkForClient(); !ok)
            return fail("browsers need a client's keys in the key file: " + ok.error().text);
    settings.folder = options.folder.string();
    settings.token = options.token.empty() && !settings.loopback ? randomToken() : options.token;
    settings.maximumConnections = options.maximumConnections;
    settings.requestTimeout = options.requestTimeout;
    settings.call = options.call;
    auto startWeb = loadWeb();
    if (!startWeb) return std::unexpected(startWeb.error());
    std::string problem;
    std::unique_ptr<WebGateway> gateway(new WebGateway);
    gateway->module_ = (*startWeb)(settings, problem);
    if (!gateway->module_) return fail(problem);
    const bool anywhere = settings.address == "0.0.0.0" || settings.address == "::";
    const std::string host = anywhere                                          ? ownAddress()
                             : settings.address.find(':') != std::string::npos ? "[" + settings.address + "]"
                                                                               : settings.address;
    gateway->url_ = fmt::format("{}://{}:{}/{}", settings.certificate.empty() ? "http" : "https", host,
                                gateway->module_->port(), settings.token.empty() ? "" : "#token=" + settings.token);
    server.admit(std::make_unique<WebListener>(gateway->module_, gateway->url_,
                                               options.keys ? options.keys->clientPublic.front() : std::string()));
    return gateway;
}

WebGateway::~WebGateway() {
    if (module_) module_->end();
}

WebGatewayStatistics WebGateway::statistics() const {
    const WebCounts counts = module_->counts();
    return {counts.connections, counts.opened, counts.requests, counts.refused};
}

void WebGateway::service(const Scene& scene, const Resources& resources) {
    for (const FileWish& wish : module_->takeWishes()) {
        std::string bytes = fileOf(scene, resources, wish);
        std::string type = wish.kind == FileWish::Kind::picture ? pictureType(bytes) : soundType(bytes);
        module_->answer(wish.number, std::move(bytes), std::move(type));
    }
}

std::vector<Diagnostic> WebGateway::takeDiagnostics() {
    std::vector<Diagnostic> result;
    const std::string page = url_.substr(0, url_.find('#'));
    for (std::string& text : module_->takeNews()) result.push_back({Severity::warning, page, {}, std::move(text)});
    return result;
}

}  // namespace rtsg
