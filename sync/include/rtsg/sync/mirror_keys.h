// MirrorKeys: the keys of a mirror for CURVE encryption, with a list of allowed clients, in a small text file.
//
// The file has lines `server-public KEY`, `server-secret KEY`, `client-public KEY` (any number of them), `client-secret
// KEY`, and comments that begin with `#`. Keys are Z85 texts of 40 characters. A server needs the server's pair and
// admits the listed clients. A client needs the server's public key and its own pair (the first client-public). Behind
// a client's public key may stand a permission (none, events, edits or code) and then the name of the key's holder. The
// name is the author of the client's requests, in logs and for undo.
// Threading: values.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// What a peer may send to the origin. Each level includes the ones before: nothing; input events; edits; and code,
/// which is anything that makes the origin open files or run programs (urls, fields that start loading, Scripts).
enum class MirrorUpstream : std::uint8_t { none, events, edits, code };
std::optional<MirrorUpstream> mirrorUpstreamFromName(std::string_view name);

struct MirrorKeys {
    std::string serverPublic, serverSecret, clientSecret;
    std::vector<std::string> clientPublic;
    std::map<std::string, MirrorUpstream> upstream;  // by client's public key; only where the file names a permission
    std::map<std::string, std::string> names;        // by client's public key; only where the file has a name

    static Result<MirrorKeys> load(const std::filesystem::path& file);
    /// Writes fresh keys for one server and one client into a new file that only its owner may read.
    static Result<> generate(const std::filesystem::path& file);
    /// Adds one client. Writes its fresh pair and the server's public key into the new file `client`, and appends its
    /// public key to the file `server`. `permission` and `name` are written behind the key unless they are empty.
    /// Errors: a file that cannot be read or written, `server` is no server's file, a name without a permission, or one
    /// with several lines.
    static Result<> addClient(const std::filesystem::path& server, const std::filesystem::path& client,
                              std::string_view permission = {}, std::string_view name = {});
    Result<> checkForServer() const;
    Result<> checkForClient() const;
};

/// True for endpoints that other machines cannot reach (ipc, inproc, tcp on loopback). Error: a malformed endpoint.
Result<bool> isLocalEndpoint(const std::string& endpoint);

}  // namespace rtsg
