// Listens for browsers, and decides who may follow.
#include "gateway.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>

#include <dlfcn.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <boost/beast/websocket/rfc6455.hpp>

#include "visit.h"
#include "web_socket_connection.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxVisits = 256;                    // connections without a WebSocket
constexpr std::size_t kQuarters = 3;                       // share of the WebSockets for an address of another machine
constexpr auto kSilent = std::chrono::seconds(2);          // a browser says at once who it is
constexpr auto kIdle = std::chrono::seconds(300);          // until a browser that does not answer pings is gone
constexpr std::size_t kLongestIncoming = 10 << 10;         // the longest message is a part of a submission
constexpr std::size_t kMaxQueued = std::size_t{80} << 20;  // more than the server sends ahead: nothing is read
constexpr std::string_view kBye("\x08\0\0\0RTSG\x01\x05\0\0", 12);

/// True if a message has the length of its first part (u32), that part, and perhaps a second one.
bool hasParts(std::string_view message) {
    std::uint32_t first = 0;
    if (message.size() < sizeof(first)) return false;
    std::memcpy(&first, message.data(), sizeof(first));
    return first > 0 && first <= message.size() - sizeof(first);
}

/// Takes equally long wherever the first wrong letter is.
bool sameToken(const std::string& given, const std::string& wanted) {
    unsigned difference = given.size() == wanted.size() ? 0 : 1;
    for (std::size_t i = 0; i < given.size() && i < wanted.size(); ++i)
        difference |=
            static_cast<unsigned char>(given[i]) ^ static_cast<unsigned>(static_cast<unsigned char>(wanted[i]));
    return difference == 0;
}

std::string tokenIn(const std::string& target) {
    const std::string key = "token=";
    const std::size_t query = target.find('?');
    for (std::size_t at = query; at != std::string::npos; at = target.find('&', at + 1))
        if (target.compare(at + 1, key.size(), key) == 0) {
            const std::size_t from = at + 1 + key.size();
            return target.substr(from, target.find('&', from) - from);
        }
    return {};
}

/// The folder beside the installed module, or where it was built.
std::string pageFolder() {
    Dl_info about{};
    std::error_code ignored;
    if (::dladdr(reinterpret_cast<void*>(&pageFolder), &about) && about.dli_fname) {
        const auto module = std::filesystem::weakly_canonical(about.dli_fname, ignored);
        for (const char* method : {"../../share/rtsg/web", "../../../share/rtsg/web"}) {
            const auto folder = (module.parent_path() / method).lexically_normal();
            if (std::filesystem::exists(folder / "page" / "index.html", ignored)) return folder.string();
        }
    }
    return RTSG_WEB_SOURCE;
}

}  // namespace

Gateway::Gateway(WebSettings settings)
    : HttpServer({settings.loopback, kMaxVisits, settings.requestTimeout, kIdle, {}, kLongestIncoming, kMaxQueued}),
      settings_(std::move(settings)),
      ring_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

std::string Gateway::start() {
    if (settings_.folder.empty()) settings_.folder = pageFolder();
    if (!findPage(settings_.folder, "/")) return "there is no page for browsers in '" + settings_.folder + "'";
    beast::error_code error;
    const auto address = net::ip::make_address(settings_.address, error);
    if (error) return "'" + settings_.address + "' is no address of this machine's";
    if (std::string why = readCertificate(); !why.empty()) return why;
    const Tcp::endpoint endpoint(address, settings_.port);
    (void)acceptor().open(endpoint.protocol(), error);
    if (!error) (void)acceptor().set_option(net::socket_base::reuse_address(true), error);
    if (!error) (void)acceptor().bind(endpoint, error);
    if (!error) (void)acceptor().listen(net::socket_base::max_listen_connections, error);
    if (error)
        return "cannot serve browsers at " + settings_.address + ":" + std::to_string(settings_.port) + ": " +
               error.message();
    port_ = acceptor().local_endpoint().port();
    open();
    return {};
}

namespace {
/// Why a TLS file cannot be read, which OpenSSL does not tell; otherwise OpenSSL's error.
std::string tlsProblem(const std::string& file, const beast::error_code& error) {
    std::error_code unreadable;
    if (std::filesystem::is_directory(file, unreadable)) return "it is a folder";
    if (::access(file.c_str(), R_OK) != 0) return std::strerror(errno);
    return error.message();
}
}  // namespace

/// Checks before serving that both files are complete and belong together.
std::string Gateway::readCertificate() {
    if (settings_.certificate.empty()) return {};
    auto tls = std::make_unique<net::ssl::context>(net::ssl::context::tls_server);
    beast::error_code error;
    (void)tls->set_options(net::ssl::context::default_workarounds | net::ssl::context::no_sslv2 |
                               net::ssl::context::no_sslv3 | net::ssl::context::no_tlsv1 |
                               net::ssl::context::no_tlsv1_1,
                           error);
    (void)tls->use_certificate_chain_file(settings_.certificate, error);
    if (error) return "no certificate in '" + settings_.certificate + "': " + tlsProblem(settings_.certificate, error);
    (void)tls->use_private_key_file(settings_.privateKey, net::ssl::context::pem, error);
    if (error)
        return "no key for that certificate in '" + settings_.privateKey +
               "': " + tlsProblem(settings_.privateKey, error);
    tls_ = std::move(tls);
    return {};
}

Gateway::~Gateway() {
    close();
    ::close(ring_);
}

void Gateway::makeRoomForBrowser() {
    if (count() < settings_.maximumConnections) return;
    std::shared_ptr<WebSocketConnection> found;
    for (const auto& [number, browser] : connections())
        if (browser->isSilentFor(kSilent) && (!found || browser->since() < found->since())) found = browser;
    if (!found) return;
    ++refused_;
    found->leave();
}

bool Gateway::heard(WebSocketConnection& from, std::string message, bool isText) {
    if (!isText && hasParts(message)) {
        pass(from.number(), std::move(message));
        return true;
    }
    ++refused_;
    news_.add("ended a browser's connection: its message makes no sense");
    return false;
}

void Gateway::ended(WebSocketConnection& connection) {
    pass(connection.number(), std::string(kBye));  // so that the server need not wait for it
}

void Gateway::pass(std::uint64_t browser, std::string message) {
    const std::scoped_lock lock(mutex_);
    if (ignores_) return resumeSoon(browser);
    messages_.emplace_back(browser, std::move(message));
    ::eventfd_write(ring_, 1);
}

bool Gateway::take(std::uint64_t& browser, std::string& message) {
    const std::scoped_lock lock(mutex_);
    if (messages_.empty()) {
        eventfd_t count = 0;
        (void)::eventfd_read(ring_, &count);
        return false;
    }
    browser = messages_.front().first;
    message = std::move(messages_.front().second);
    messages_.pop_front();
    resumeSoon(browser);
    return true;
}

void Gateway::ignore() {
    const std::scoped_lock lock(mutex_);
    ignores_ = true;
    for (const auto& [browser, message] : messages_) resumeSoon(browser);
    messages_.clear();
}

bool Gateway::send(std::uint64_t browser, std::string head, std::span<const std::byte> second,
                   std::shared_ptr<const void> owner) {
    if (say(browser, {std::move(head), second, std::move(owner)})) return true;
    leaveSoon(browser);  // it reads nothing, if it is there at all
    return false;
}

std::vector<FileWish> Gateway::takeWishes() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(wishes_, {});
}

void Gateway::answer(std::uint64_t wish, std::string bytes, std::string type) {
    net::post(io(), [this, wish, bytes = std::move(bytes), type = std::move(type)]() mutable {
        const auto found = wishing_.extract(wish);
        const std::shared_ptr<Visit> visit = found ? found.mapped().lock() : nullptr;
        if (visit) visit->show(std::move(bytes), type);
    });
}

std::string Gateway::refusal(const Request& request, const std::string& source) const {
    const std::string target = textOf(request.target()), host = textOf(request[http::field::host]);
    const std::string origin = textOf(request[http::field::origin]);
    if (!knowsHost(request)) return "This server is known by another name.";
    if (!origin.empty() && origin != "http://" + host && origin != "https://" + host)
        return "Pages of other sites may not follow.";
    if (!settings_.token.empty() && !sameToken(tokenIn(target), settings_.token))
        return "The token is missing or wrong.";
    const bool follows = beast::websocket::is_upgrade(request);
    if (follows && target.substr(0, target.find('?')) != "/mirror") return "There is nothing to follow here.";
    if (follows && count() >= settings_.maximumConnections) return "As many browsers follow as may.";
    const auto ofSource = static_cast<std::size_t>(
        std::ranges::count_if(connections(), [&](const auto& one) { return one.second->source() == source; }));
    if (follows && !isShared(source) && 4 * ofSource >= kQuarters * settings_.maximumConnections)
        return "As many browsers of one address follow as may.";
    return {};
}

}  // namespace rtsg::web

namespace {

std::unique_ptr<rtsg::WebModule> startWeb(const rtsg::WebSettings& settings, std::string& problem) {
    auto gateway = std::make_unique<rtsg::web::Gateway>(settings);
    problem = gateway->start();
    if (!problem.empty()) return nullptr;
    return gateway;
}

}  // namespace

/// The program looks this symbol up and calls it to get the function above.
extern "C" __attribute__((visibility("default"))) rtsg::StartWeb rtsg_start_web_5() {
    return startWeb;
}
