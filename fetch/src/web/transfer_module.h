// TransferModule: what librtsg_curl.so offers, one GET without redirects, and SHA-256. Nothing else compiles or links
// libcurl.
//
// Invariant: the module links nothing of ours. Problems are sentences, or parts of one. Threading: any thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include <sys/socket.h>

#include <rtsg/core/diagnostic.h>

namespace rtsg::fetch {

struct TransferRequest {
    std::string address;
    std::string etag, lastModified;  // of the copy that exists already; or empty
    std::string certificates;        // a PEM file of authorities; empty: the system's
    double connectSeconds = 10;      // until there is a connection, TLS and all
    double stallSeconds = 15;        // without a byte
    double totalSeconds = 300;
    std::uint64_t maximumBytes = 0;  // of the body, unpacked
    /// Asked for each address that a connection would be made to, before it is.
    std::function<bool(const sockaddr&)> mayConnect;
    /// Takes the body, unpacked, piece by piece; false ends the transfer.
    std::function<bool(std::string_view)> take;
    const std::atomic<bool>* stop = nullptr;  // ends the transfer once it is true
};

struct TransferAnswer {
    std::string problem;  // empty: there is an answer
    int status = 0;       // 200 and the like
    std::string etag{}, lastModified{}, location{}, mediaType{}, cacheControl{};
};

struct TransferModule {
    TransferAnswer (*get)(const TransferRequest& request);
    std::string (*sha256)(std::string_view bytes);  // 64 hexadecimal digits
};
/// The one symbol of the module: a function without arguments that returns a const TransferModule*.
#define RTSG_CURL_SYMBOL "rtsg_open_curl_1"

/// Loads it, once. Errors: this build leaves it out; no such module.
Result<const TransferModule*> transferModule();

}  // namespace rtsg::fetch
