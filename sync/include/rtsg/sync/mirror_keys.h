// Keys of a mirror: CURVE encryption and an allow-list, from a small text file.
//
// The file has lines `server-public KEY`, `server-secret KEY`, `client-public KEY` (any number of them),
// `client-secret KEY` and comments from `#` on; keys are Z85, 40 characters. A server needs the server's pair and lets
// in the clients listed; a client needs the server's public key and a pair of its own (the first client-public). After
// a client's public key may stand what it may send upstream: none, events, edits or code; and behind that the name of
// whoever holds the key, under which what they ask for is logged and taken back. Threading: values.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// What a peer may send to the origin, each including the one before: nothing; input events; edits; and what makes the
/// origin open files or run programs: urls, what starts loading them, and Scripts.
enum class MirrorUpstream : std::uint8_t { none, events, edits, code };
std::optional<MirrorUpstream> mirrorUpstreamFromName(std::string_view name);

struct MirrorKeys {
    std::string serverPublic, serverSecret, clientSecret;
    std::vector<std::string> clientPublic;
    std::map<std::string, MirrorUpstream> upstream;  // of clients' public keys for which the file says it
    std::map<std::string, std::string> names;        // likewise

    static Result<MirrorKeys> load(const std::filesystem::path& file);
    /// Fresh keys for one server and one client, in a new file that only its owner may read.
    static Result<> generate(const std::filesystem::path& file);
    /// Fresh keys for one more client: its own and the server's public one in a new file, its public one at the end of
    /// the server's. `permission`: what it may send, as the file has it, and `name`: its holder's; empty: not said.
    /// Errors: files that cannot be read or written, no server's file, a name without permission or of several lines.
    static Result<> addClient(const std::filesystem::path& server, const std::filesystem::path& client,
                              std::string_view permission = {}, std::string_view name = {});
    Result<> checkForServer() const;
    Result<> checkForClient() const;
};

/// True for endpoints that no other machine can reach (ipc, inproc, tcp on loopback); an error for malformed ones.
Result<bool> isLocalEndpoint(const std::string& endpoint);

}  // namespace rtsg
