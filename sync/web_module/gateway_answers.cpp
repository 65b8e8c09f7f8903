// What a gateway answers: files of the page, files that the scene names, and WebSockets.
#include <charconv>
#include <random>
#include <string_view>

#include <sys/eventfd.h>
#include <boost/beast/websocket/rfc6455.hpp>

#include "gateway.h"
#include "visit.h"

namespace rtsg::web {

namespace {

constexpr std::size_t kMaxWishes = 64;  // files that wait for the scene's thread
constexpr std::size_t kWorthPacking = 1 << 10;
constexpr std::pair<std::string_view, FileWish::Kind> kNamed[] = {{"/picture/", FileWish::Kind::picture},
                                                                  {"/sound/", FileWish::Kind::sound}};

/// A nonce for one answer. Only scripts of the page that carry it may run.
std::string freshNonce() {
    std::random_device device;
    std::string result;
    for (int i = 0; i < 4; ++i) result += std::to_string(device());
    return result;
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

}  // namespace

/// The page's file, or the status that there is none.
Response Gateway::page(const Request& request) {
    const std::string target = textOf(request.target()), known = textOf(request[http::field::if_none_match]);
    const auto file = findPage(settings_.folder, std::string_view(target).substr(0, target.find('?')));
    auto text = file ? readPage(*file) : std::nullopt;
    if (!text) return {http::status::not_found, request.version()};
    if (known == file->tag || known == tagOfPacked(file->tag)) {
        Response same(http::status::not_modified, request.version());
        same.set(http::field::etag, known);
        return same;
    }
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
        if (std::string bytes = takesGzip(request) ? packedPage(*file, *text) : ""; !bytes.empty()) {
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

/// Handles `/picture/NODE/INDEX` and `/sound/NODE/INDEX`. Other paths under these names do not exist.
bool Gateway::wish(const Request& request, const std::shared_ptr<Visit>& visit) {
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
    std::erase_if(wishing_, [](const auto& w) { return w.second.expired(); });
    if (wishing_.size() >= kMaxWishes) return false;
    wish.number = ++wishNumber_;
    wishing_[wish.number] = visit;
    const std::scoped_lock lock(mutex_);
    wishes_.push_back(wish);
    if (settings_.call >= 0) ::eventfd_write(settings_.call, 1);
    return true;
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

void Gateway::answer(const std::shared_ptr<Visit>& visit, Request request) {
    ++requests_;
    if (!hostOf(request)) {
        ++refused_;
        return visit->refuse(http::status::bad_request, "The request names no host, or not one.");
    }
    const bool wantsSocket = beast::websocket::is_upgrade(request);
    const bool wantsNamed = namedIn(request) != nullptr;
    if (wantsSocket) makeRoomForBrowser();
    std::string why = wantsSocket || wantsNamed ? refusal(request, visit->source()) : "";
    if (wantsSocket && why.empty()) {
        ++opened_;
        return begin(visit->release(), std::move(request), visit->source());
    }
    if (why.empty() && !knowsHost(request)) why = "This server is known by another name.";
    if (!why.empty()) {
        ++refused_;
        news_.add("refused a request: " + why);
        return visit->refuse(http::status::forbidden, std::move(why));
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
        return visit->refuse(http::status::method_not_allowed, "Only GET and HEAD are answered.");
    if (wantsNamed && wish(request, visit)) return visit->wait();
    Response response = wantsNamed ? Response(http::status::not_found, request.version()) : page(request);
    if (response.result() == http::status::not_found)
        return visit->refuse(http::status::not_found, "There is no such file.");
    response.keep_alive(request.keep_alive());
    response.prepare_payload();
    if (request.method() == http::verb::head) response.body().clear();  // the length stays that of the file
    visit->say(std::move(response));
}

}  // namespace rtsg::web
