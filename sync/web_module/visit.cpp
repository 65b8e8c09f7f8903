// Answers requests for files of the page, and hands over to a Browser.
#include "visit.h"

#include <charconv>
#include <chrono>
#include <random>
#include <string_view>

#include <boost/beast/websocket/rfc6455.hpp>

#include "browser.h"
#include "pages.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kLongestHead = 8 << 10, kLongestBody = 1 << 10;
constexpr std::size_t kSlowestReader = 4 << 10;  // bytes a second
constexpr std::pair<std::string_view, FileWish::Kind> kNamed[] = {{"/picture/", FileWish::Kind::picture},
                                                                  {"/sound/", FileWish::Kind::sound}};

using Response = http::response<http::string_body>;

/// A nonce for one answer. Only scripts of the page that carry it may run.
std::string freshNonce() {
    std::random_device device;
    std::string result;
    for (int i = 0; i < 4; ++i) result += std::to_string(device());
    return result;
}

Response refused(const Request& request, http::status status, std::string why) {
    Response response(status, request.version());
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = std::move(why) + "\n";
    response.keep_alive(false);
    return response;
}

/// The row of kNamed for this request. Null if there is none.
const std::pair<std::string_view, FileWish::Kind>* namedIn(const Request& request) {
    for (const auto& row : kNamed)
        if (request.target().starts_with(beast::string_view(row.first.data(), row.first.size()))) return &row;
    return nullptr;
}

/// The content security policy: the page may load its own files, WebAssembly, and pictures that it makes itself.
std::string policyWith(const std::string& nonce) {
    return "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'" +
           (nonce.empty() ? "" : " 'nonce-" + nonce + "'") +
           "; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; media-src 'self' data: blob:; "
           "connect-src 'self' data: blob:; worker-src 'self' blob:; font-src 'self' data:; object-src 'none'; "
           "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
}

bool takesGzip(const Request& request) {
    const std::string coding = textOf(request[http::field::accept_encoding]);
    const std::size_t at = coding.find("gzip");
    return at != std::string::npos && coding.compare(at + 4, 4, ";q=0") != 0;
}

/// The tag of the same file as gzip, which is another representation.
std::string tagOfPacked(const std::string& tag) {
    return tag.substr(0, tag.size() - 1) + "-gzip\"";
}

Response page(const Request& request, Gateway& gateway) {
    const std::string target = textOf(request.target()), known = textOf(request[http::field::if_none_match]);
    const auto file = findPage(gateway.settings().folder, std::string_view(target).substr(0, target.find('?')));
    if (!file) return refused(request, http::status::not_found, "There is no such file.");
    if (known == file->tag || known == tagOfPacked(file->tag)) {
        Response same(http::status::not_modified, request.version());
        same.set(http::field::etag, known);
        return same;
    }
    auto text = readPage(*file);
    if (!text) return refused(request, http::status::not_found, "The file cannot be read.");
    Response response(http::status::ok, request.version());
    response.set(http::field::content_type, beast::string_view(file->type.data(), file->type.size()));
    std::string nonce;
    const std::string mark = "@NONCE@";
    if (const std::size_t at = text->find(mark); file->type.starts_with("text/html") && at != std::string::npos) {
        nonce = freshNonce();
        text->replace(at, mark.size(), nonce);
        response.set(http::field::cache_control, "no-store");
    } else {
        response.set(http::field::cache_control, "no-cache");
        response.set(http::field::etag, file->tag);
        if (std::string bytes = takesGzip(request) ? gateway.packedPage(*file, *text) : ""; !bytes.empty()) {
            *text = std::move(bytes);
            response.set(http::field::content_encoding, "gzip");
            response.set(http::field::etag, tagOfPacked(file->tag));
        }
        response.set(http::field::vary, "Accept-Encoding");
    }
    if (file->type.starts_with("text/html")) response.set("Content-Security-Policy", policyWith(nonce));
    response.body() = std::move(*text);
    return response;
}

}  // namespace

Visit::Visit(Gateway& gateway, Tcp::socket&& socket)
    : gateway_(gateway),
      source_(sourceOf(socket)),
      stream_(std::move(socket), gateway.tls()),
      buffer_(kLongestHead + kLongestBody),
      waiting_(gateway.io()) {
    gateway_.came(this);
}

void Visit::end() {
    gateway_.went(this);
    stream_.tcp().close();
}

void Visit::begin() {
    if (!gateway_.tls()) return read();
    stream_.tcp().expires_after(gateway_.settings().requestTimeout);
    stream_.handshake([self = shared_from_this()](beast::error_code error) {
        if (!error) return self->read();
        ++self->gateway_.refused;
    });
}

void Visit::read() {
    parser_.emplace();
    parser_->header_limit(kLongestHead);
    parser_->body_limit(kLongestBody);
    stream_.tcp().expires_after(gateway_.settings().requestTimeout);
    http::async_read(stream_, buffer_, *parser_,
                     Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                         if (!error) return self->answer(self->parser_->release());
                         self->refuse(error);
                     }));
}

/// The request was invalid, or none came.
void Visit::refuse(beast::error_code error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout || error == net::error::eof ||
        error == net::error::operation_aborted || error == net::error::connection_reset ||
        error == net::ssl::error::stream_truncated)
        return;
    ++gateway_.refused;
    const bool isOfHttp = error.category() == beast::error_code(http::error::end_of_stream).category();
    if (!isOfHttp || error == http::error::partial_message) return;
    if (error == http::error::header_limit || error == http::error::buffer_overflow)
        return say(refused({}, http::status::request_header_fields_too_large, "The request's head is too long."));
    if (error == http::error::body_limit)
        return say(refused({}, http::status::payload_too_large, "The request's body is too long."));
    say(refused({}, http::status::bad_request, "This is no request of HTTP/1.1."));
}

/// Handles `/picture/NODE/INDEX` and `/sound/NODE/INDEX`. Other paths under these names do not exist.
bool Visit::wish(const Request& request) {
    const std::string target = textOf(request.target());
    const auto& [name, kind] = *namedIn(request);
    const char* at = target.data() + name.size();
    const char* const end = target.data() + target.size();
    FileWish wish;
    wish.kind = kind;
    const auto node = std::from_chars(at, end, wish.node);
    if (node.ec != std::errc() || node.ptr == end || *node.ptr != '/') return false;
    const auto index = std::from_chars(node.ptr + 1, end, wish.index);
    if (index.ec != std::errc() || (index.ptr != end && *index.ptr != '?')) return false;
    keepAlive_ = request.keep_alive();
    version_ = request.version();
    return gateway_.wish(wish, weak_from_this());
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

void Visit::answer(Request request) {
    ++gateway_.requests;
    state_ = State::busy;
    since_ = std::chrono::steady_clock::now();
    if (!hostOf(request)) {
        ++gateway_.refused;
        return say(refused(request, http::status::bad_request, "The request names no host, or not one."));
    }
    const bool wantsSocket = beast::websocket::is_upgrade(request);
    const bool wantsNamed = namedIn(request) != nullptr;
    if (wantsSocket) gateway_.makeRoomForBrowser();
    std::string why = wantsSocket || wantsNamed ? gateway_.refusal(request, source_) : "";
    if (wantsSocket && why.empty()) {
        stream_.tcp().expires_never();
        std::make_shared<Browser>(gateway_, std::move(stream_), source_)->begin(std::move(request));
        return;
    }
    if (why.empty() && !gateway_.knowsHost(request)) why = "This server is known by another name.";
    if (!why.empty()) {
        ++gateway_.refused;
        gateway_.news("refused a request: " + why);
        return say(refused(request, http::status::forbidden, std::move(why)));
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
        return say(refused(request, http::status::method_not_allowed, "Only GET and HEAD are answered."));
    if (wantsNamed) {
        if (!wish(request)) return say(refused(request, http::status::not_found, "There is no such file."));
        // Stays alive until the scene's thread answers, or until the request times out.
        stream_.tcp().expires_after(gateway_.settings().requestTimeout);
        waiting_.expires_after(gateway_.settings().requestTimeout);
        waiting_.async_wait([self = shared_from_this()](beast::error_code) {});
        return;
    }
    Response response = page(request, gateway_);
    response.keep_alive(request.keep_alive());
    response.prepare_payload();
    if (request.method() == http::verb::head) response.body().clear();  // the length stays that of the file
    say(std::move(response));
}

void Visit::say(Response response) {
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    if (!response.has_content_length()) response.prepare_payload();
    response_ = std::move(response);
    // A slow reader gets the time that the slowest links need, but not longer.
    stream_.tcp().expires_after(gateway_.settings().requestTimeout +
                                std::chrono::seconds(response_.body().size() / kSlowestReader));
    http::async_write(stream_, response_, Moved([self = shared_from_this()](beast::error_code error, std::size_t) {
                          self->state_ = State::idle;
                          if (!error && self->response_.keep_alive()) return self->read();
                          self->stream_.shutdown([self](beast::error_code) {});
                      }));
}

}  // namespace rtsg::web
