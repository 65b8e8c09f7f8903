// WebFetcher: fetches files from http and https addresses that the user allows (FetchRules), by libcurl.
//
// Each redirect is checked like the first address, and each connection by the IP address that it goes to, so that no
// name, redirect or answer of a name server leads elsewhere. There are no proxies, passwords, cookies or other
// protocols; certificates are checked. Unpacked bytes and seconds are bounded. A fetched file is kept as long as the
// fetcher lives, and in a cache folder that processes share, from which it is reused if the server says that it has not
// changed. Contents from a log or a peer need no network and no permission; if a log or a peer has only their hashes,
// contents with other hashes are refused. Threading: any thread; each address is fetched once. Source: RFC 9110, RFC
// 9111.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/url_fetcher.h>
#include <rtsg/fetch/fetch_rules.h>

namespace rtsg {

struct FetchSettings {
    FetchRules rules;
    std::filesystem::path certificates;  // a PEM file of certificate authorities; replaces the system's
    std::filesystem::path cache;         // a folder that nothing else uses; empty: no cache
    std::uint64_t cacheBytes = std::uint64_t{1} << 30;
    std::uint64_t totalBytes = std::uint64_t{4} << 30;  // of all files together
    std::size_t totalFiles = 10'000;
    double connectSeconds = 10;  // until the connection is made
    double stallSeconds = 15;    // without receiving a byte
    double totalSeconds = 300;   // for one file
    /// awaits() starts to fetch on threads of the fetcher and does not block.
    bool inBackground = false;
    /// No server is asked: files come from the cache folder as they were when they were fetched last, or not at all.
    bool offline = false;
    /// Called for each address that `offline` serves from the cache, once, on any thread; null: nobody hears of it.
    std::function<void(const std::string& address)> fromCache;
};

/// The folder for this user's cache: rtsg/web below $XDG_CACHE_HOME or ~/.cache. Empty if there is neither.
std::filesystem::path userFetchCache();

/// A file from an address. Without bytes it tells which content the address had.
struct FetchedFile {
    std::string address, source;  // the requested one; the one that answered, after redirects
    std::string mediaType;
    std::string hash;  // SHA-256, 64 hexadecimal digits
    std::string bytes;
    bool hasBytes = false;
};

class WebFetcher final : public UrlFetcher {
  public:
    explicit WebFetcher(FetchSettings settings);
    /// Ends the transfers under way.
    ~WebFetcher() override;
    WebFetcher(const WebFetcher&) = delete;
    WebFetcher& operator=(const WebFetcher&) = delete;

    Result<FetchedContent> fetch(const std::string& address, std::uint64_t maximumBytes) override;
    bool awaits(const std::string& address, std::uint64_t maximumBytes) override;

    /// Calls `take` for each file that came from the network since the call that returned `from`, in order; 0: since
    /// the beginning. Returns the number for the next call. Files given to keep() are left out.
    std::size_t forEachFetched(std::size_t from, bool withBytes, const std::function<void(FetchedFile)>& take) const;
    /// From now on the address of the file has this content, and no other.
    Result<> keep(FetchedFile file);
    /// Whether keep() has been given the bytes of any file.
    bool hasKeptBytes() const;
    const FetchSettings& settings() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
