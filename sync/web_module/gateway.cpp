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

#include "browser.h"
#include "sockets/http_host.h"
#include "visit.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxVisits = 256;            // connections without a WebSocket
constexpr std::size_t kMaxOfSource = 64;           // the same, for one address of another machine
constexpr std::size_t kQuarters = 3;               // share of the WebSockets for such an address
constexpr auto kSlow = std::chrono::seconds(5);    // answers that take longer may be cut off
constexpr auto kSilent = std::chrono::seconds(2);  // a browser says at once who it is
constexpr auto kGatewayFarewell = std::chrono::milliseconds(500);
constexpr auto kAcceptAgain = std::chrono::milliseconds(50);  // after the system had no descriptor left
constexpr std::size_t kMaxWishes = 64;                        // files that wait for the scene's thread
constexpr std::size_t kWorthPacking = 1 << 10;

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
    : settings_(std::move(settings)), ring_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

std::string Gateway::start() {
    if (settings_.folder.empty()) settings_.folder = pageFolder();
    if (!findPage(settings_.folder, "/")) return "there is no page for browsers in '" + settings_.folder + "'";
    beast::error_code error;
    const auto address = net::ip::make_address(settings_.address, error);
    if (error) return "'" + settings_.address + "' is no address of this machine's";
    if (std::string why = readCertificate(); !why.empty()) return why;
    const Tcp::endpoint endpoint(address, settings_.port);
    (void)acceptor_.open(endpoint.protocol(), error);
    if (!error) (void)acceptor_.set_option(net::socket_base::reuse_address(true), error);
    if (!error) (void)acceptor_.bind(endpoint, error);
    if (!error) (void)acceptor_.listen(net::socket_base::max_listen_connections, error);
    if (error)
        return "cannot serve browsers at " + settings_.address + ":" + std::to_string(settings_.port) + ": " +
               error.message();
    port_ = acceptor_.local_endpoint().port();
    accept();
    thread_ = std::thread([this] { io_.run(); });
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
    end();
    ::close(ring_);
}

void Gateway::end() {
    if (!thread_.joinable()) return;
    net::post(io_, [this] { stop(); });
    thread_.join();
    const std::set<Browser*> late = browsers_;
    for (Browser* browser : late) browser->leave();
}

void Gateway::accept() {
    acceptor_.async_accept([this](beast::error_code error, Tcp::socket socket) {
        if (stopping_ || error == net::error::operation_aborted) return;
        if (error) {
            again_.expires_after(kAcceptAgain);
            again_.async_wait([this](beast::error_code stopped) {
                if (!stopped) accept();
            });
            return;
        }
        if (makeRoomFor(sourceOf(socket)))
            std::make_shared<Visit>(*this, std::move(socket))->begin();
        else
            ++refused;
        accept();
    });
}

/// On loopback, and behind a proxy on this machine, all users have one address.
bool Gateway::isShared(const std::string& source) const {
    beast::error_code error;
    const auto address = net::ip::make_address(source, error);
    return settings_.loopback || (!error && address.is_loopback());
}

/// Closes a connection if there are too many: the oldest of the address that has most. First choice is one without a
/// request yet, then an idle one, then one that takes its answer slowly. Returns false if all are busy.
bool Gateway::makeRoomFor(const std::string& source) {
    std::map<std::string, std::size_t> bySource;
    for (const Visit* visit : visits_) ++bySource[visit->source()];
    const bool hasQuota = !isShared(source) && bySource[source] >= kMaxOfSource;
    if (visits_.size() < kMaxVisits && !hasQuota) return true;
    const auto slow = std::chrono::steady_clock::now() - kSlow;
    for (const Visit::State state : {Visit::State::silent, Visit::State::idle, Visit::State::busy}) {
        Visit* found = nullptr;
        for (Visit* visit : visits_) {
            if (state == Visit::State::busy && visit->since() > slow) continue;
            if (visit->state() != state || (hasQuota && visit->source() != source)) continue;
            if (!found || bySource[visit->source()] > bySource[found->source()]) found = visit;
        }
        if (!found) continue;
        ++refused;
        found->end();
        return true;
    }
    return false;
}

void Gateway::makeRoomForBrowser() {
    if (connections_ < settings_.maximumConnections) return;
    Browser* found = nullptr;
    for (Browser* browser : browsers_)
        if (browser->isSilentFor(kSilent) && (!found || browser->since() < found->since())) found = browser;
    if (!found) return;
    ++refused;
    found->leave();
}

void Gateway::stop() {
    stopping_ = true;
    beast::error_code ignored;
    (void)acceptor_.close(ignored);
    deadline_.expires_after(kGatewayFarewell);
    deadline_.async_wait([this](beast::error_code) { io_.stop(); });
    const std::set<Browser*> now = browsers_;
    for (Browser* browser : now) browser->end();
    if (browsers_.empty()) io_.stop();
}

std::uint64_t Gateway::came(Browser* browser) {
    browsers_.insert(browser);
    ++opened_;
    connections_ = browsers_.size();
    const std::scoped_lock lock(mutex_);
    here_.insert(++lastBrowser_);
    return lastBrowser_;
}

void Gateway::heard(std::uint64_t browser, std::string message) {
    const std::scoped_lock lock(mutex_);
    if (ignores_) return resumeSoon(browser);
    messages_.emplace_back(browser, std::move(message));
    ::eventfd_write(ring_, 1);
}

void Gateway::resumeSoon(std::uint64_t browser) {
    net::post(io_, [this, browser] {
        if (const auto found = find(browser)) found->resume();
    });
}

Browser* Gateway::find(std::uint64_t number) const {
    const auto found = std::ranges::find(browsers_, number, [](const Browser* browser) { return browser->number(); });
    return found == browsers_.end() ? nullptr : *found;
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
    {
        const std::scoped_lock lock(mutex_);
        if (!here_.contains(browser)) return false;
    }
    net::post(io_, [this, browser, head = std::move(head), second, owner = std::move(owner)]() mutable {
        if (const auto found = find(browser)) found->push(std::move(head), second, std::move(owner));
    });
    return true;
}

void Gateway::went(Browser* browser) {
    {
        const std::scoped_lock lock(mutex_);
        here_.erase(browser->number());
    }
    browsers_.erase(browser);
    connections_ = browsers_.size();
    if (stopping_ && browsers_.empty()) io_.stop();
}

WebCounts Gateway::counts() const {
    return {connections_, opened_, requests, refused};
}

bool Gateway::wish(FileWish wish, std::weak_ptr<Visit> visit) {
    std::erase_if(wishing_, [](const auto& w) { return w.second.expired(); });
    if (wishing_.size() >= kMaxWishes) return false;
    wish.number = ++wishNumber_;
    wishing_[wish.number] = std::move(visit);
    const std::scoped_lock lock(mutex_);
    wishes_.push_back(wish);
    if (settings_.call >= 0) ::eventfd_write(settings_.call, 1);
    return true;
}

std::vector<FileWish> Gateway::takeWishes() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(wishes_, {});
}

void Gateway::answer(std::uint64_t wish, std::string bytes, std::string type) {
    net::post(io_, [this, wish, bytes = std::move(bytes), type = std::move(type)]() mutable {
        const auto found = wishing_.extract(wish);
        const std::shared_ptr<Visit> visit = found ? found.mapped().lock() : nullptr;
        if (visit) visit->show(std::move(bytes), type);
    });
}

std::string Gateway::packedPage(const PageFile& file, const std::string& text) {
    if (settings_.loopback || text.size() < kWorthPacking || !isWorthPacking(file)) return {};
    auto& [tag, bytes] = packed_[file.path];
    if (tag != file.tag) {
        bytes = packed(text);
        tag = file.tag;
    }
    return bytes;
}

std::string sourceOf(const Tcp::socket& socket) {
    beast::error_code error;
    auto address = socket.remote_endpoint(error).address();
    if (!address.is_v6()) return address.to_string();
    if (address.to_v6().is_v4_mapped())
        return net::ip::make_address_v4(net::ip::v4_mapped, address.to_v6()).to_string();
    if (address.is_loopback()) return address.to_string();
    auto bytes = address.to_v6().to_bytes();
    std::fill(bytes.begin() + bytes.size() / 2, bytes.end(), static_cast<unsigned char>(0));
    return net::ip::address_v6(bytes).to_string();
}

std::optional<std::string> hostOf(const Request& request) {
    constexpr unsigned kHttp11 = 11;
    const std::size_t count = request.count(http::field::host);
    if (count == 0 && request.version() < kHttp11) return "";
    if (count != 1) return std::nullopt;
    return detail::hostIn(textOf(request[http::field::host]));
}

bool Gateway::knowsHost(const Request& request) const {
    return !settings_.loopback || namesThisMachine(request);
}

bool namesThisMachine(const Request& request) {
    return detail::isThisMachine(hostOf(request).value_or(""));
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
    if (follows && connections_ >= settings_.maximumConnections) return "As many browsers follow as may.";
    const auto ofSource = static_cast<std::size_t>(
        std::ranges::count_if(browsers_, [&](const Browser* browser) { return browser->source() == source; }));
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
