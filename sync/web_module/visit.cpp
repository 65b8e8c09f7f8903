// Reads requests of HTTP, and sends the answers that there are.
#include "visit.h"

#include <algorithm>
#include <chrono>

namespace rtsg::web {

namespace {

constexpr std::size_t kLongestHead = 8 << 10, kLongestBody = 1 << 10;
constexpr std::size_t kSlowestReader = 4 << 10;  // bytes a second

}  // namespace

Visit::Visit(HttpServer& server, Tcp::socket&& socket)
    : server_(server),
      source_(sourceOf(socket)),
      stream_(std::move(socket), server.tls()),
      buffer_(kLongestHead + kLongestBody),
      waiting_(server.io()) {
    server_.came(this);
}

void Visit::end() {
    server_.went(this);
    stream_.tcp().close();
}

void Visit::begin() {
    if (!server_.tls()) return read();
    stream_.tcp().expires_after(server_.rules().requestTimeout);
    stream_.handshake([self = shared_from_this()](beast::error_code error) {
        if (!error) return self->read();
        self->server_.refuse("");
    });
}

void Visit::read() {
    parser_.emplace();
    parser_->header_limit(kLongestHead);
    parser_->body_limit(kLongestBody);
    stream_.tcp().expires_after(server_.rules().requestTimeout);
    http::async_read(stream_, buffer_, *parser_,
                     Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                         if (error) return self->failed(error);
                         Request request = self->parser_->release();
                         self->state_ = State::busy;
                         self->since_ = std::chrono::steady_clock::now();
                         self->keepAlive_ = request.keep_alive();
                         self->version_ = request.version();
                         self->server_.answer(self, std::move(request));
                     }));
}

/// The request was invalid, or none came.
void Visit::failed(beast::error_code error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout || error == net::error::eof ||
        error == net::error::operation_aborted || error == net::error::connection_reset ||
        error == net::ssl::error::stream_truncated)
        return;
    server_.refuse("no request of HTTP/1.1 came");
    const bool isOfHttp = error.category() == beast::error_code(http::error::end_of_stream).category();
    if (!isOfHttp || error == http::error::partial_message) return;
    if (error == http::error::header_limit || error == http::error::buffer_overflow)
        return refuse(http::status::request_header_fields_too_large, "The request's head is too long.");
    if (error == http::error::body_limit)
        return refuse(http::status::payload_too_large, "The request's body is too long.");
    refuse(http::status::bad_request, "This is no request of HTTP/1.1.");
}

void Visit::refuse(http::status status, std::string why) {
    Response response(status, version_);
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = std::move(why) + "\n";
    response.keep_alive(false);
    say(std::move(response));
}

void Visit::wait() {
    stream_.tcp().expires_after(server_.rules().requestTimeout);
    waiting_.expires_after(server_.rules().requestTimeout);
    waiting_.async_wait([self = shared_from_this()](beast::error_code) {});
}

void Visit::show(std::string bytes, const std::string& type) {
    Response response(type.empty() ? http::status::not_found : http::status::ok, version_);
    response.set(http::field::content_type, type.empty() ? "text/plain" : type);
    response.set(http::field::cache_control, "no-store");
    response.body() = type.empty() ? "There is no such file.\n" : std::move(bytes);
    response.keep_alive(keepAlive_);
    waiting_.cancel();
    say(std::move(response));
}

Stream&& Visit::release() {
    stream_.tcp().expires_never();
    return std::move(stream_);
}

void Visit::say(Response response) {
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    if (!response.has_content_length()) response.prepare_payload();
    response_ = std::move(response);
    // A slow reader gets the time that the slowest links need, but not longer.
    stream_.tcp().expires_after(server_.rules().requestTimeout +
                                std::chrono::seconds(response_.body().size() / kSlowestReader));
    http::async_write(stream_, response_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                          self->state_ = State::idle;
                          if (!error && self->response_.keep_alive()) return self->read();
                          self->stream_.shutdown([self](beast::error_code) {});
                      }));
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

}  // namespace rtsg::web
