// Serves metrics, and fetches them.
#include <rtsg/feeds/metrics_server.h>

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <optional>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/worker.h>

#include "endpoint.h"
#include "sockets/http_host.h"

namespace rtsg {

namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::size_t kMaxAsking = 64, kLongestRequest = 4096, kLongestAnswer = std::size_t{4} << 20;
constexpr auto kRequestTime = std::chrono::seconds(5);

Result<feeds::Endpoint> metricsEndpoint(std::string text) {
    if (const std::size_t scheme = text.find("://"); scheme != text.npos) {
        if (!text.starts_with("http://")) return fail(fmt::format("{}: expected PORT or HOST:PORT", text));
        text = text.substr(scheme + 3);
    }
    return feeds::Endpoint::ofPort(text.substr(0, text.find('/')));
}

/// The value of a field of a request; nothing if it is not there once.
std::optional<std::string_view> fieldOf(std::string_view request, std::string_view name) {
    const auto isSame = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; };
    std::optional<std::string_view> found;
    for (std::size_t at = request.find("\r\n"); at != request.npos; at = request.find("\r\n", at)) {
        at += 2;
        std::string_view line = request.substr(at, request.find("\r\n", at) - at);
        if (line.size() <= name.size() || line[name.size()] != ':' ||
            !std::ranges::equal(line.substr(0, name.size()), name, isSame))
            continue;
        if (found) return std::nullopt;
        line.remove_prefix(name.size() + 1);
        const std::size_t begin = line.find_first_not_of(" \t");
        found = begin == line.npos ? "" : line.substr(begin, line.find_last_not_of(" \t") - begin + 1);
    }
    return found;
}

std::string answerWith(std::string_view status, std::string_view body, bool head) {
    return fmt::format(
        "HTTP/1.1 {}\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: {}\r\n"
        "Cache-Control: no-store\r\nConnection: close\r\n\r\n{}",
        status, body.size(), head ? std::string_view() : body);
}

}  // namespace

struct MetricsServer::State {
    /// One connection: it asks, then it is answered.
    struct Asking {
        Descriptor socket;
        SteadyClock::time_point end;
        std::string request, answer;
        std::size_t sent = 0;
    };

    void run();
    void accept();
    /// Returns false if the connection is done.
    bool poll(Asking& one);
    std::string answer(std::string_view request);
    /// What an exception ends is one answer.
    std::string answerOrFailure(std::string_view request);

    bool isLoopback = true;
    Descriptor socket;
    Wakeup stop;
    std::string address;
    std::function<std::string()> text, trouble;
    std::vector<Asking> asking;
    Worker worker{"rtsg metrics"};  // last: its job uses the others
};

MetricsServer::MetricsServer(std::unique_ptr<State> state) : state_(std::move(state)) {}

MetricsServer::~MetricsServer() = default;

const std::string& MetricsServer::address() const {
    return state_->address;
}

Result<std::unique_ptr<MetricsServer>> MetricsServer::start(const std::string& listen, bool insecure,
                                                            std::function<std::string()> text,
                                                            std::function<std::string()> trouble) {
    auto endpoint = metricsEndpoint(listen);
    if (!endpoint) return std::unexpected(endpoint.error());
    auto socket = feeds::listenAt(*endpoint, insecure);
    if (!socket) return std::unexpected(socket.error());
    auto state = std::make_unique<State>();
    const auto at = feeds::findAddress(*endpoint);
    state->isLoopback = at && at->isLoopback();
    state->socket = std::move(*socket);
    state->address = endpoint->text.substr(endpoint->text.find("://") + 3);
    state->text = std::move(text);
    state->trouble = std::move(trouble);
    state->worker.run([s = state.get()] { s->run(); }, [s = state.get()] { s->stop.raise(); });
    return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(state)));
}

void MetricsServer::State::run() {
    std::vector<pollfd> items;
    while (true) {
        items.assign({{stop.get(), POLLIN, 0}, {socket.get(), POLLIN, 0}});
        for (const Asking& one : asking)
            items.push_back({one.socket.get(), static_cast<short>(one.answer.empty() ? POLLIN : POLLOUT), 0});
        if (::poll(items.data(), items.size(), asking.empty() ? -1 : 200) < 0) continue;
        if (items[0].revents != 0) return;
        const auto now = SteadyClock::now();
        std::erase_if(asking, [&](Asking& one) { return now > one.end || !poll(one); });
        if (items[1].revents != 0) accept();
    }
}

void MetricsServer::State::accept() {
    Descriptor one(::accept4(socket.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (one.get() >= 0) {
        // Silence keeps nobody out: the oldest that has not asked yet makes room, or the oldest of all.
        if (asking.size() >= kMaxAsking) {
            const auto silent = std::ranges::find_if(asking, [](const Asking& old) { return old.answer.empty(); });
            asking.erase(silent == asking.end() ? asking.begin() : silent);
        }
        return asking.push_back({std::move(one), SteadyClock::now() + kRequestTime, {}, {}});
    }
    if (errno != EAGAIN && errno != EINTR) std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

bool MetricsServer::State::poll(Asking& one) {
    if (one.answer.empty()) {
        char bytes[kLongestRequest];
        const ssize_t size = ::recv(one.socket.get(), bytes, sizeof(bytes), 0);
        if (size <= 0) return size < 0 && (errno == EAGAIN || errno == EINTR);
        one.request.append(bytes, static_cast<std::size_t>(size));
        const bool whole = one.request.find("\r\n\r\n") != std::string::npos;
        if (!whole && one.request.size() <= kLongestRequest) return true;
        one.answer =
            whole ? answerOrFailure(one.request) : answerWith("431 Request Header Fields Too Large", "", false);
    }
    const ssize_t size =
        ::send(one.socket.get(), one.answer.data() + one.sent, one.answer.size() - one.sent, MSG_NOSIGNAL);
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    one.sent += static_cast<std::size_t>(size);
    return one.sent < one.answer.size();
}

std::string MetricsServer::State::answerOrFailure(std::string_view request) {
    try {
        return answer(request);
    } catch (const std::exception& e) {
        return answerWith("500 Internal Server Error", std::string(e.what()) + "\n", false);
    }
}

std::string MetricsServer::State::answer(std::string_view request) {
    const std::size_t space = request.find(' ');
    const std::string_view method = request.substr(0, space);
    const auto host = detail::hostIn(fieldOf(request, "host").value_or(""));
    const std::string_view origin = fieldOf(request, "origin").value_or("");
    if (!host) return answerWith("400 Bad Request", "The request names no host, or not one.\n", false);
    if (isLoopback && !detail::isThisMachine(*host))
        return answerWith("403 Forbidden", "This server is known by another name.\n", false);
    if (!origin.empty() && !detail::isOriginOfThisMachine(origin))
        return answerWith("403 Forbidden", "Pages of other sites may not ask.\n", false);
    if (method != "GET" && method != "HEAD")
        return answerWith("405 Method Not Allowed", "Only GET and HEAD are answered.\n", false);
    std::string_view target = request.substr(space + 1);
    target = target.substr(0, target.find_first_of(" ?\r"));
    if (target == "/healthz") {
        const std::string sentence = trouble ? trouble() : std::string();
        return answerWith(sentence.empty() ? "200 OK" : "503 Service Unavailable",
                          sentence.empty() ? "ok\n" : sentence + "\n", method == "HEAD");
    }
    if (target != "/metrics")
        return answerWith("404 Not Found", "There are /metrics and /healthz.\n", method == "HEAD");
    return answerWith("200 OK", text(), method == "HEAD");
}

Result<std::string> fetchMetrics(const std::string& address) {
    const auto endpoint = metricsEndpoint(address);
    if (!endpoint) return std::unexpected(endpoint.error());
    const auto at = feeds::findAddress(*endpoint);
    if (!at) return std::unexpected(at.error());
    const Descriptor socket(::socket(at->storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const timeval patience = {std::chrono::seconds(kRequestTime).count(), 0};
    for (const int option : {SO_RCVTIMEO, SO_SNDTIMEO})
        (void)::setsockopt(socket.get(), SOL_SOCKET, option, &patience, sizeof(patience));
    if (socket.get() < 0 || ::connect(socket.get(), at->get(), at->length) != 0)
        return fail(feeds::systemError("ask", *endpoint));
    const bool isSix = endpoint->host.find(':') != std::string::npos;
    const std::string request = fmt::format("GET /metrics HTTP/1.1\r\nHost: {}{}{}\r\nConnection: close\r\n\r\n",
                                            isSix ? "[" : "", endpoint->host, isSix ? "]" : "");
    if (::send(socket.get(), request.data(), request.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(request.size()))
        return fail(feeds::systemError("ask", *endpoint));
    std::string answer(1 << 16, '\0');
    std::size_t size = 0;
    const auto end = SteadyClock::now() + kRequestTime;
    for (ssize_t more = 1; more > 0; size += static_cast<std::size_t>(more)) {
        if (size == answer.size()) answer.resize(2 * size);
        if (size > kLongestAnswer) return fail(fmt::format("{}: its answer is too long", endpoint->text));
        more = ::recv(socket.get(), answer.data() + size, answer.size() - size, 0);
        if ((more < 0 && errno == EAGAIN) || (more > 0 && SteadyClock::now() > end))
            return fail(fmt::format("{}: no whole answer has come for {} s", endpoint->text,
                                    std::chrono::seconds(kRequestTime).count()));
        if (more < 0) return fail(feeds::systemError("hear", *endpoint));
    }
    answer.resize(size);
    const std::size_t body = answer.find("\r\n\r\n");
    if (!answer.starts_with("HTTP/1.1 200 ") || body == answer.npos)
        return fail(fmt::format("{}: it serves no figures", endpoint->text));
    return answer.substr(body + 4);
}

void MetricsText::head(std::string_view name, std::string_view kind, std::string_view help) {
    if (last_ == name) return;
    last_ = name;
    text_ += fmt::format("# HELP {} {}\n# TYPE {} {}\n", name, help, name, kind);
}

void MetricsText::add(std::string_view name, Kind kind, std::string_view help, double value, std::string_view labels) {
    head(name, kind == Kind::counter ? "counter" : "gauge", help);
    text_ += fmt::format("{}{} {}\n", name, labels, value);
}

void MetricsText::addHistogram(std::string_view name, std::string_view help, std::span<const double> bounds,
                               std::span<const std::uint64_t> counts, double sum) {
    head(name, "histogram", help);
    std::uint64_t all = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        all += counts[i];
        const std::string bound = i < bounds.size() ? fmt::format("{}", bounds[i]) : "+Inf";
        text_ += fmt::format("{}_bucket{{le=\"{}\"}} {}\n", name, bound, all);
    }
    text_ += fmt::format("{}_sum {}\n{}_count {}\n", name, sum, name, all);
}

std::string MetricsText::label(std::string_view name, std::string_view value) {
    std::string text = fmt::format("{{{}=\"", name);
    for (const char c : value) {
        if (c == '"' || c == '\\') text += '\\';
        text += c == '\n' ? ' ' : c;
    }
    return text + "\"}";
}

}  // namespace rtsg
