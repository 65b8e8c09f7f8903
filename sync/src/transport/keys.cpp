// Reads, checks and generates key files, and tells whether an endpoint is local.
#include <rtsg/sync/mirror_keys.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zmq.h>

#include "zmq_socket.h"

namespace rtsg {

namespace {

constexpr std::size_t kLongestName = 200;

bool isKey(const std::string& text) {
    std::uint8_t bytes[32];
    return text.size() == 40 && zmq_z85_decode(bytes, text.c_str()) != nullptr;
}

}  // namespace

std::optional<MirrorUpstream> mirrorUpstreamFromName(std::string_view name) {
    if (name == "none") return MirrorUpstream::none;
    if (name == "events") return MirrorUpstream::events;
    if (name == "edits") return MirrorUpstream::edits;
    if (name == "code") return MirrorUpstream::code;
    return std::nullopt;
}

Result<MirrorKeys> MirrorKeys::load(const std::filesystem::path& file) {
    std::ifstream in(file);
    if (!in) return fail(fmt::format("cannot read: {}", std::strerror(errno)), {}, file.string());
    if (const auto loaded = delayed::zmq.load(); !loaded) return std::unexpected(loaded.error());
    MirrorKeys keys;
    std::string line;
    for (std::uint32_t number = 1; std::getline(in, line); ++number) {
        // A key may contain '#', so only a line that starts with one is a comment.
        const std::size_t first = line.find_first_not_of(" \t\r");
        if (first == line.npos || line[first] == '#') continue;
        const std::size_t space = line.find_first_of(" \t", first);
        const std::string what = line.substr(first, space == line.npos ? space : space - first);
        std::string key = space == line.npos ? "" : line.substr(line.find_first_not_of(" \t", space));
        while (!key.empty() && std::strchr(" \t\r", key.back())) key.pop_back();
        std::optional<MirrorUpstream> upstream;
        std::string name;
        if (const std::size_t end = key.find_first_of(" \t"); what == "client-public" && end != key.npos) {
            std::string permission = key.substr(key.find_first_not_of(" \t", end));
            if (const std::size_t next = permission.find_first_of(" \t"); next != permission.npos) {
                name = permission.substr(permission.find_first_not_of(" \t", next));
                permission.resize(next);
            }
            upstream = mirrorUpstreamFromName(permission);
            if (!upstream)
                return fail(fmt::format("'{}' after a key is none of none, events, edits, code", permission),
                            {number, 1}, file.string());
            key.resize(end);
        }
        if (!isKey(key))
            return fail(fmt::format("no key of 40 Z85 characters after '{}'", what), {number, 1}, file.string());
        if (what == "server-public")
            keys.serverPublic = key;
        else if (what == "server-secret")
            keys.serverSecret = key;
        else if (what == "client-public")
            keys.clientPublic.push_back(key);
        else if (what == "client-secret")
            keys.clientSecret = key;
        else
            return fail(fmt::format("unknown kind of key '{}'", what), {number, 1}, file.string());
        if (upstream) keys.upstream[key] = *upstream;
        if (name.size() > kLongestName)
            return fail(fmt::format("a name of {} bytes, the most is {}", name.size(), kLongestName), {number, 1},
                        file.string());
        if (!name.empty()) keys.names[key] = name;
    }
    return keys;
}

namespace {

struct Pair {
    char open[41], secret[41];
};
Result<Pair> freshPair() {
    if (const auto loaded = delayed::zmq.load(); !loaded) return std::unexpected(loaded.error());
    Pair pair{};
    if (zmq_curve_keypair(pair.open, pair.secret) != 0) return fail("ZeroMQ was built without encryption");
    return pair;
}

enum class Writing : std::uint8_t { anew, atTheEnd };

Result<> writeKeys(const std::filesystem::path& file, const std::string& text, Writing how) {
    const int flags = how == Writing::anew ? O_CREAT | O_EXCL : O_APPEND;
    const int descriptor = ::open(file.c_str(), O_WRONLY | O_CLOEXEC | flags, 0600);
    if (descriptor < 0)
        return fail(fmt::format("cannot {}: {}", how == Writing::anew ? "create" : "write", std::strerror(errno)), {},
                    file.string());
    errno = 0;  // a full disk may write a part without setting errno
    const bool written = ::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    const int error = errno;
    ::close(descriptor);
    if (written) return {};
    if (how == Writing::anew) ::unlink(file.c_str());  // a partial key file is of no use
    return fail(fmt::format("cannot write: {}", error != 0 ? std::strerror(error) : "no room"), {}, file.string());
}

}  // namespace

Result<> MirrorKeys::generate(const std::filesystem::path& file) {
    const auto server = freshPair(), client = freshPair();
    if (!server || !client) return std::unexpected((server ? client : server).error());
    return writeKeys(
        file,
        fmt::format("# Keys of a server of mirrors, and of one client: keep secret. `rtsg keys` adds more.\n"
                    "server-public {}\nserver-secret {}\nclient-public {}\nclient-secret {}\n",
                    server->open, server->secret, client->open, client->secret),
        Writing::anew);
}

Result<> MirrorKeys::addClient(const std::filesystem::path& server, const std::filesystem::path& client,
                               std::string_view permission, std::string_view name) {
    if (!permission.empty() && !mirrorUpstreamFromName(permission))
        return fail(fmt::format("'{}' is none of none, events, edits, code", permission));
    if (!name.empty() && permission.empty()) return fail("a name stands behind what its holder may send");
    if (name.size() > kLongestName || name.find_first_of("\r\n") != name.npos)
        return fail(fmt::format("a name is one line of at most {} bytes", kLongestName));
    const auto known = load(server);
    if (!known) return std::unexpected(known.error());
    if (known->serverPublic.empty() || known->serverSecret.empty())
        return fail("no server's: it lacks server-public or server-secret", {}, server.string());
    const auto pair = freshPair();
    if (!pair) return std::unexpected(pair.error());
    const std::string own =
        fmt::format("# Keys of a mirror's client: keep secret.\nserver-public {}\nclient-public {}\nclient-secret {}\n",
                    known->serverPublic, pair->open, pair->secret);
    if (auto ok = writeKeys(client, own, Writing::anew); !ok) return ok;
    // The last line may lack its line end.
    const std::string line = fmt::format("\nclient-public {}{}{}{}{}\n", pair->open, permission.empty() ? "" : " ",
                                         permission, name.empty() ? "" : " ", name);
    const Result<> added = writeKeys(server, line, Writing::atTheEnd);
    if (!added) ::unlink(client.c_str());
    return added;
}

Result<> MirrorKeys::checkForServer() const {
    if (serverPublic.empty() || serverSecret.empty()) return fail("a server needs server-public and server-secret");
    if (clientPublic.empty()) return fail("no client-public: nobody could connect");
    return {};
}

Result<> MirrorKeys::checkForClient() const {
    if (serverPublic.empty()) return fail("a client needs server-public");
    if (clientPublic.empty() || clientSecret.empty()) return fail("a client needs client-public and client-secret");
    return {};
}

Result<bool> isLocalEndpoint(const std::string& endpoint) {
    if (endpoint.starts_with("ipc://") || endpoint.starts_with("inproc://")) return true;
    const std::size_t colon = endpoint.rfind(':');
    if (!endpoint.starts_with("tcp://") || colon < 6 || colon + 1 >= endpoint.size())
        return fail(fmt::format("'{}' is no endpoint: tcp://HOST:PORT or ipc://PATH", endpoint));
    if (auto port = checkPort(endpoint); !port) return std::unexpected(port.error());
    const std::string host = endpoint.substr(6, colon - 6);
    if (host == "localhost" || host == "[::1]") return true;
    in_addr address{};
    return ::inet_pton(AF_INET, host.c_str(), &address) == 1 && (ntohl(address.s_addr) >> 24) == 127;
}

}  // namespace rtsg
