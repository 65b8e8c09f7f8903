// Reads what a live viewer asks for.
#include "viewer_request.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "json_scanner.h"

namespace rtsg::feeds {

namespace {

/// Reads the members of an object: `member(key)` reads each value.
bool readObject(JsonScanner& in, const auto& member) {
    std::string key;
    if (!in.take('{')) return in.refuse("expected '{'");
    if (in.take('}')) return true;
    do {
        if (!in.string(key) || !(in.take(':') || in.refuse("expected ':'")) || !member(key)) return false;
    } while (in.take(','));
    return in.take('}') || in.refuse("expected ',' or '}'");
}

bool readArray(JsonScanner& in, const auto& element) {
    if (!in.take('[')) return in.refuse("expected '['");
    if (in.take(']')) return true;
    do {
        if (!element()) return false;
    } while (in.take(','));
    return in.take(']') || in.refuse("expected ',' or ']'");
}

bool readId(JsonScanner& in, std::optional<std::uint32_t>& id) {
    std::string_view word;
    if (in.next() == '"' || in.next() == '[' || in.next() == '{') return in.refuse("expected a number");
    if (!in.word(word)) return false;
    std::uint32_t number = 0;
    const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (problem != std::errc() || end != word.data() + word.size())
        return in.refuse(fmt::format("{} is no number of a subscription or channel", word));
    id = number;
    return true;
}

}  // namespace

Result<ViewerRequest> readViewerRequest(std::string text) {
    std::ranges::replace(text, '\n', ' ');  // the scanner is for lines
    JsonScanner in(text);
    ViewerRequest request;
    const auto subscription = [&] {
        std::optional<std::uint32_t> id, channel;
        const bool read = readObject(in, [&](const std::string& key) {
            return key == "id" ? readId(in, id) : key == "channelId" ? readId(in, channel) : in.skip();
        });
        if (read && (!id || !channel)) return in.refuse("a subscription has an id and a channelId");
        if (read) request.subscriptions.emplace_back(*id, *channel);
        return read;
    };
    const auto ended = [&] {
        std::optional<std::uint32_t> id;
        if (!readId(in, id)) return false;
        request.ended.push_back(*id);
        return true;
    };
    const bool whole = readObject(in, [&](const std::string& key) {
        if (key == "op") return in.string(request.op);
        if (key == "subscriptions") return readArray(in, subscription);
        if (key == "subscriptionIds") return readArray(in, ended);
        return in.skip();
    });
    if (whole && !in.atEnd()) in.refuse("more follows after the object");
    if (in.failed()) return std::unexpected(in.problem());
    if (request.op.empty()) return fail("a message has an op");
    return request;
}

}  // namespace rtsg::feeds
