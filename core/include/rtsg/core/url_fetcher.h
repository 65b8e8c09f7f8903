// UrlFetcher: what brings files from addresses of the network for Resources (resource.h), which knows no network.
//
// The one of the program is rtsg/fetch/web_fetcher.h. Invariant: an address has one content as long as the fetcher
// lives, so that all who open it see the same bytes. Threading: any thread.
#pragma once

#include <cstdint>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct FetchedContent {
    std::string address;    // that answered, after redirects
    std::string mediaType;  // as the server states it, without parameters; or empty
    int descriptor = -1;    // a file of these bytes, open at its beginning, for the caller to close
};

class UrlFetcher {
  public:
    virtual ~UrlFetcher() = default;

    /// Waits for what stands at an address, which WebAddress (web_address.h) has brought into its one form. Errors: it
    /// is not allowed, more than `maximumBytes`, or what happened on the way.
    virtual Result<FetchedContent> fetch(const std::string& address, std::uint64_t maximumBytes) = 0;
    /// Starts that. True as long as fetch() would wait; false if this fetcher always fetches while one waits.
    virtual bool awaits(const std::string& address, std::uint64_t maximumBytes) = 0;
};

}  // namespace rtsg
