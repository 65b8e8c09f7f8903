// Reads the messages of an editor from a stream of bytes, and writes answers to one.
#include <rtsg/documents/language_server.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

namespace rtsg {

namespace {

constexpr DiagnosticCode kEditor{"editor"};
constexpr std::size_t kMaxHeaderBytes = 4096;

/// Messages behind headers that say how long they are (LSP 3.17, Base Protocol).
class MessageReader {
  public:
    MessageReader(int descriptor, std::uint64_t maximumBytes) : descriptor_(descriptor), maximum_(maximumBytes) {}

    /// Whether something of the next message is there.
    bool hasInput(int milliseconds = 0) const {
        pollfd one{descriptor_, POLLIN, 0};
        return !buffer_.empty() || ::poll(&one, 1, milliseconds) > 0;
    }
    /// Waits for a whole message. Nothing: the stream has ended between two.
    Result<std::optional<std::string>> next() {
        std::size_t behind = 0;
        while ((behind = headerEnd()) == 0) {
            if (buffer_.size() > kMaxHeaderBytes) return fail(kEditor, "a message begins with no header");
            if (auto more = fill(); !more)
                return std::unexpected(more.error());
            else if (!*more && buffer_.empty())
                return std::optional<std::string>();
            else if (!*more)
                return fail(kEditor, "the editor's messages end within a header");
        }
        const auto length = lengthIn(std::string_view(buffer_).substr(0, behind));
        if (!length) return std::unexpected(length.error());
        while (buffer_.size() - behind < *length) {
            if (auto more = fill(); !more)
                return std::unexpected(more.error());
            else if (!*more)
                return fail(kEditor, "the editor's messages end within one");
        }
        std::string message = buffer_.substr(behind, *length);
        buffer_.erase(0, behind + *length);
        return std::optional(std::move(message));
    }

  private:
    std::size_t headerEnd() const {
        const std::size_t end = buffer_.find("\r\n\r\n");
        return end == buffer_.npos ? 0 : end + 4;
    }
    Result<std::size_t> lengthIn(std::string_view header) const {
        constexpr std::string_view kLength = "content-length:";
        std::optional<std::size_t> length;
        for (std::size_t at = 0; at < header.size();) {
            const std::size_t end = header.find("\r\n", at);
            std::string line(header.substr(at, end - at));
            at = end + 2;
            std::ranges::transform(line, line.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c; });
            if (!line.starts_with(kLength)) continue;
            const std::size_t digits = std::min(line.find_first_not_of(" \t", kLength.size()), line.size());
            std::uint64_t number = 0;
            const char* const last = line.data() + line.size();
            const auto [stop, error] = std::from_chars(line.data() + digits, last, number);
            if (error != std::errc() || stop != last || length)
                return fail(kEditor, fmt::format("'{}' is no length of a message", line.substr(0, 80)));
            if (number > maximum_)
                return fail(kEditor, fmt::format("a message of {} bytes: at most {} are taken", number, maximum_));
            length = static_cast<std::size_t>(number);
        }
        if (!length) return fail(kEditor, "a message has no Content-Length");
        return *length;
    }
    /// False: the stream has ended.
    Result<bool> fill() {
        char block[1 << 16];
        ssize_t count = 0;
        do count = ::read(descriptor_, block, sizeof block);
        while (count < 0 && errno == EINTR);
        if (count < 0) return fail(kEditor, fmt::format("the editor's messages: {}", std::strerror(errno)));
        buffer_.append(block, static_cast<std::size_t>(count));
        return count > 0;
    }

    const int descriptor_;
    const std::uint64_t maximum_;
    std::string buffer_;
};

/// False: nobody reads.
bool writeAll(int descriptor, std::string_view text) {
    while (!text.empty()) {
        const ssize_t count = ::write(descriptor, text.data(), text.size());
        if (count < 0 && errno != EINTR) return false;
        if (count > 0) text.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
}

}  // namespace

Result<> serveEditor(int in, int out, const LanguageServerOptions& given) {
    constexpr int kPause = 150;  // ms without a message, after which somebody has stopped typing
    MessageReader reader(in, given.maximumBytes);
    LanguageServerOptions options = given;
    options.isAwaited = [&] { return reader.hasInput(); };
    bool isRead = true;
    LanguageServer server(options, [&](std::string_view message) {
        isRead = isRead && writeAll(out, fmt::format("Content-Length: {}\r\n\r\n", message.size())) &&
                 writeAll(out, message);
    });
    while (isRead) {
        while (server.hasWork() && !reader.hasInput(kPause)) server.work();
        const auto message = reader.next();
        if (!message) return std::unexpected(message.error());
        if (!*message) return fail(kEditor, "the editor is gone without an exit");
        server.receive(**message);
        if (!server.hasEnded()) continue;
        if (!server.wasAsked()) return fail(kEditor, "the editor said exit before shutdown");
        return {};
    }
    return fail(kEditor, "the editor reads no answers");
}

}  // namespace rtsg
