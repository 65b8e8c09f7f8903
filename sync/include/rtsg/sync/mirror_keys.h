// Keys of a mirror: CURVE encryption and an allow-list, from a small text file.
//
// The file has lines `server-public KEY`, `server-secret KEY`, `client-public KEY` (any number of them),
// `client-secret KEY` and comments from `#` on; keys are Z85, 40 characters. A server needs the server's pair and lets
// in the clients listed; a client needs the server's public key and a pair of its own (the first client-public).
// Threading: values.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct MirrorKeys {
    std::string serverPublic, serverSecret, clientSecret;
    std::vector<std::string> clientPublic;

    static Result<MirrorKeys> load(const std::filesystem::path& file);
    /// Fresh keys for one server and one client, in a new file that only its owner may read.
    static Result<> generate(const std::filesystem::path& file);
    Result<> checkForServer() const;
    Result<> checkForClient() const;
};

/// True for endpoints that no other machine can reach (ipc, inproc, tcp on loopback); an error for malformed ones.
Result<bool> isLocalEndpoint(const std::string& endpoint);

}  // namespace rtsg
