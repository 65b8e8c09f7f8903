// One GET by libcurl: bounded in bytes and time, to addresses that are allowed when they are connected to.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include <curl/curl.h>
#include <openssl/evp.h>

#include "web/transfer_module.h"

namespace rtsg::fetch {

namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{64} << 10;  // of all answers of a transfer, 1xx too
constexpr std::size_t kMaxFieldBytes = 1000;                    // of a header field that is kept

struct Transfer {
    const TransferRequest& request;
    TransferAnswer answer{};
    std::uint64_t bytes = 0;
    std::size_t headerBytes = 0;
    std::string why{};  // why we ended it
};

bool beginsWith(std::string_view text, std::string_view name) {
    return text.size() >= name.size() && std::ranges::equal(text.substr(0, name.size()), name, [](char a, char b) {
               return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b;
           });
}

std::string_view trimmed(std::string_view text) {
    const std::size_t begin = std::min(text.find_first_not_of(" \t\r\n"), text.size());
    return text.substr(begin, text.find_last_not_of(" \t\r\n") + 1 - begin);
}

std::size_t takeHeader(char* data, std::size_t size, std::size_t count, void* self) {
    Transfer& transfer = *static_cast<Transfer*>(self);
    const std::string_view line(data, size * count);
    transfer.headerBytes += line.size();
    if (transfer.headerBytes > kMaxHeaderBytes) {
        transfer.why = "the server's headers do not end";
        return 0;
    }
    TransferAnswer& answer = transfer.answer;
    if (beginsWith(line, "http/")) answer = {};  // what came before was of an answer that another one follows
    const std::pair<std::string_view, std::string*> known[] = {{"etag:", &answer.etag},
                                                               {"last-modified:", &answer.lastModified},
                                                               {"location:", &answer.location},
                                                               {"content-type:", &answer.mediaType},
                                                               {"cache-control:", &answer.cacheControl}};
    for (const auto& [name, field] : known) {
        if (!beginsWith(line, name)) continue;
        const std::string_view value = trimmed(line.substr(name.size()));
        if (value.size() <= kMaxFieldBytes || field == &answer.location) *field = value;
    }
    return line.size();
}

std::size_t takeBody(char* data, std::size_t size, std::size_t count, void* self) {
    Transfer& transfer = *static_cast<Transfer*>(self);
    const std::string_view bytes(data, size * count);
    transfer.bytes += bytes.size();
    if (transfer.bytes > transfer.request.maximumBytes) {
        transfer.why =
            "it has more than " + std::to_string(transfer.request.maximumBytes) + " bytes; --limit bytes=N raises this";
        return 0;
    }
    if (!transfer.request.take(bytes)) {
        transfer.why = "there is no room for it";
        return 0;
    }
    return bytes.size();
}

/// Names may be made to lead anywhere, and to another place each time: what counts is where the connection goes.
curl_socket_t openSocket(void* self, curlsocktype purpose, curl_sockaddr* address) {
    Transfer& transfer = *static_cast<Transfer*>(self);
    if (purpose != CURLSOCKTYPE_IPCXN || !transfer.request.mayConnect(address->addr)) {
        transfer.why = "its server's address is a private one; --allow-network lets it be connected to";
        return CURL_SOCKET_BAD;
    }
    return ::socket(address->family, address->socktype | SOCK_CLOEXEC, address->protocol);
}

int goOn(void* self, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
    const Transfer& transfer = *static_cast<const Transfer*>(self);
    return transfer.request.stop && transfer.request.stop->load() ? 1 : 0;
}

long milliseconds(double seconds) {
    return std::max(1L, std::lround(seconds * 1e3));
}

std::string problemOf(CURLcode code, const Transfer& transfer, const char* details) {
    if (!transfer.why.empty()) return transfer.why;
    switch (code) {
        case CURLE_OPERATION_TIMEDOUT:
            return "the server took too long (" + std::string(details) + ")";
        case CURLE_PARTIAL_FILE:
            return "it ended before all of it was there";
        case CURLE_ABORTED_BY_CALLBACK:
            return "it was not waited for";
        case CURLE_FILESIZE_EXCEEDED:
            return "it has more than " + std::to_string(transfer.request.maximumBytes) +
                   " bytes; --limit bytes=N raises this";
        case CURLE_PEER_FAILED_VERIFICATION:
        case CURLE_SSL_CACERT_BADFILE:
            return std::string("its certificate is not trusted: ") + (*details ? details : curl_easy_strerror(code));
        default:
            return *details ? details : curl_easy_strerror(code);
    }
}

struct HandleEnd {
    void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
};
struct ListEnd {
    void operator()(curl_slist* list) const { curl_slist_free_all(list); }
};
using Handle = std::unique_ptr<CURL, HandleEnd>;
using List = std::unique_ptr<curl_slist, ListEnd>;

void append(List& list, const std::string& line) {
    if (curl_slist* longer = curl_slist_append(list.get(), line.c_str())) {
        (void)list.release();
        list.reset(longer);
    }
}

void limit(CURL* handle, const TransferRequest& request) {
    curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT_MS, milliseconds(request.connectSeconds));
    curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, milliseconds(request.totalSeconds));
    curl_easy_setopt(handle, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(handle, CURLOPT_LOW_SPEED_TIME, std::max(1L, std::lround(request.stallSeconds)));
    curl_easy_setopt(handle, CURLOPT_MAXFILESIZE_LARGE, static_cast<curl_off_t>(request.maximumBytes));
    curl_easy_setopt(handle, CURLOPT_FOLLOWLOCATION, 0L);
    // A proxy would connect in our stead, where nobody asks mayConnect.
    curl_easy_setopt(handle, CURLOPT_PROXY, "");
#if LIBCURL_VERSION_NUM >= 0x075500
    curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
#else
    curl_easy_setopt(handle, CURLOPT_PROTOCOLS, static_cast<long>(CURLPROTO_HTTP | CURLPROTO_HTTPS));
#endif
    curl_easy_setopt(handle, CURLOPT_NETRC, static_cast<long>(CURL_NETRC_IGNORED));
    curl_easy_setopt(handle, CURLOPT_SSL_VERIFYPEER, 1L);
    curl_easy_setopt(handle, CURLOPT_SSL_VERIFYHOST, 2L);
    curl_easy_setopt(handle, CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
    if (!request.certificates.empty()) {
        curl_easy_setopt(handle, CURLOPT_CAINFO, request.certificates.c_str());
        curl_easy_setopt(handle, CURLOPT_CAPATH, nullptr);
    }
}

void listen(CURL* handle, Transfer& transfer) {
    curl_easy_setopt(handle, CURLOPT_OPENSOCKETFUNCTION, openSocket);
    curl_easy_setopt(handle, CURLOPT_OPENSOCKETDATA, &transfer);
    curl_easy_setopt(handle, CURLOPT_HEADERFUNCTION, takeHeader);
    curl_easy_setopt(handle, CURLOPT_HEADERDATA, &transfer);
    curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, takeBody);
    curl_easy_setopt(handle, CURLOPT_WRITEDATA, &transfer);
    curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, goOn);
    curl_easy_setopt(handle, CURLOPT_XFERINFODATA, &transfer);
    curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
}

TransferAnswer get(const TransferRequest& request) {
    static const CURLcode begun = curl_global_init(CURL_GLOBAL_DEFAULT);
    const Handle handle(begun == CURLE_OK ? curl_easy_init() : nullptr);
    if (!handle) return {.problem = "libcurl does not start"};
    Transfer transfer{request};
    std::array<char, CURL_ERROR_SIZE> details{};
    List headers;
    if (!request.etag.empty()) append(headers, "If-None-Match: " + request.etag);
    if (!request.lastModified.empty()) append(headers, "If-Modified-Since: " + request.lastModified);
    curl_easy_setopt(handle.get(), CURLOPT_ERRORBUFFER, details.data());
    curl_easy_setopt(handle.get(), CURLOPT_URL, request.address.c_str());
    curl_easy_setopt(handle.get(), CURLOPT_PATH_AS_IS, 1L);
    curl_easy_setopt(handle.get(), CURLOPT_USERAGENT, "rtsg");
    curl_easy_setopt(handle.get(), CURLOPT_ACCEPT_ENCODING, "gzip, deflate");
    curl_easy_setopt(handle.get(), CURLOPT_HTTPHEADER, headers.get());
    limit(handle.get(), request);
    listen(handle.get(), transfer);
    const CURLcode code = curl_easy_perform(handle.get());
    if (code != CURLE_OK) {
        transfer.answer.problem = problemOf(code, transfer, details.data());
        return std::move(transfer.answer);
    }
    long status = 0;
    curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
    transfer.answer.status = static_cast<int>(status);
    const std::string type = transfer.answer.mediaType;
    transfer.answer.mediaType = trimmed(std::string_view(type).substr(0, type.find(';')));
    return std::move(transfer.answer);
}

std::string sha256(std::string_view bytes) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned length = 0;
    EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr);
    std::string result;
    constexpr std::string_view kDigits = "0123456789abcdef";
    for (unsigned i = 0; i < length; ++i) {
        result += kDigits[digest[i] >> 4];
        result += kDigits[digest[i] & 15u];
    }
    return result;
}

constexpr TransferModule kModule{get, sha256};

}  // namespace

}  // namespace rtsg::fetch

extern "C" __attribute__((visibility("default"))) const rtsg::fetch::TransferModule* rtsg_open_curl_1() {
    return &rtsg::fetch::kModule;
}
