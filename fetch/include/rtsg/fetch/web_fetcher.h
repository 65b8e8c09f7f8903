// WebFetcher: fetches files from http and https addresses that the user allows (FetchRules), by libcurl.
//
// Each redirect is checked like the address that led to it, and each connection where it goes, so that no name,
// redirect or answer of a name server leads elsewhere. No proxies, passwords, cookies or other protocols; certificates
// are checked. Bytes, unpacked, and seconds are bounded. What has come is kept as long as the fetcher lives, and in a
// folder that processes share, from which it is taken again if the server says that it has not changed. Contents that a
// log or a peer brings along need no network and no permission; where it brings their hashes, others are refused.
// Threading: any thread; each address is fetched once. Source: RFC 9110, RFC 9111.
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
    std::filesystem::path certificates;  // a PEM file of authorities instead of the system's
    std::filesystem::path cache;         // a folder of ours alone; empty: none
    std::uint64_t cacheBytes = std::uint64_t{1} << 30;
    std::uint64_t totalBytes = std::uint64_t{4} << 30;  // of all files together
    std::size_t totalFiles = 10'000;
    double connectSeconds = 10;  // until there is a connection
    double stallSeconds = 15;    // without a byte
    double totalSeconds = 300;   // of one file
    /// awaits() starts to fetch on threads of the fetcher, and nobody need wait.
    bool inBackground = false;
};

/// The folder for this user's cache: rtsg/web below $XDG_CACHE_HOME or ~/.cache. Empty if there is neither.
std::filesystem::path userFetchCache();

/// What came from an address. Without bytes it tells which content it had.
struct FetchedFile {
    std::string address, source;  // that was asked for; that answered, after redirects
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

    /// Calls `take` for what has come from the network since the call that returned `from`, in order; 0: since the
    /// beginning. Returns what to call with next. Not for what keep() brought.
    std::size_t forEachFetched(std::size_t from, bool withBytes, const std::function<void(FetchedFile)>& take) const;
    /// From now on its address has this content, and no other.
    Result<> keep(FetchedFile file);
    /// Whether keep() has brought the bytes of any.
    bool hasKeptBytes() const;
    const FetchSettings& settings() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
